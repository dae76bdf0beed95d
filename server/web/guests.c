#include "web/guests.h"

#include "base/check.h"
#include "web/rate_limits.h"

#include <openssl/sha.h>
#include <stdlib.h>
#include <string.h>

#define GUESTS_MAX 512 // more than connections, to remember some without
#define TOKENS_EACH 8  // an account that signs in once more forgets its oldest

struct entry {
    struct guest guest;
    bool known;
    uint8_t tokens[TOKENS_EACH][SHA256_DIGEST_LENGTH]; // hashes; zero: none
    int next;
    int64_t seen_ns;
};

struct guests {
    struct entry entries[GUESTS_MAX];
};

_Static_assert(GUESTS_MAX > WEB_CONNECTIONS_MAX, "there is always one without a connection");

struct guests *guests_create(void) {
    return alloc(1, sizeof(struct guests));
}

void guests_destroy(struct guests **guests) {
    free(*guests);
    *guests = NULL;
}

static uint8_t *find_hash(struct entry *entry, const uint8_t hash[SHA256_DIGEST_LENGTH]) {
    for (int i = 0; i < TOKENS_EACH; i++)
        if (!memcmp(entry->tokens[i], hash, SHA256_DIGEST_LENGTH))
            return entry->tokens[i];
    return NULL;
}

// *out_hash: where it is kept.
static struct entry *find(struct guests *guests, const char *token, uint8_t **out_hash) {
    uint8_t hash[SHA256_DIGEST_LENGTH];
    SHA256((const uint8_t *)token, strlen(token), hash);
    for (int i = 0; i < GUESTS_MAX; i++)
        if (guests->entries[i].known && (*out_hash = find_hash(&guests->entries[i], hash)))
            return &guests->entries[i];
    return NULL;
}

struct guest *guests_find(struct guests *guests, const char *token, int64_t now_ns) {
    uint8_t *hash;
    struct entry *entry = find(guests, token, &hash);
    if (!entry)
        return NULL;
    entry->seen_ns = now_ns;
    return &entry->guest;
}

void guests_forget(struct guests *guests, const char *token) {
    uint8_t *hash;
    if (find(guests, token, &hash))
        memset(hash, 0, SHA256_DIGEST_LENGTH);
}

static bool is_account(const struct web_account *a, const struct web_account *b) {
    return !strcmp(a->name, b->name) && !strcmp(a->role, b->role) &&
           !strcmp(a->trainee, b->trainee);
}

// The account's; else that which was seen last of all, one that was never used before any other.
static struct entry *place_for(struct guests *guests, const struct web_account *account) {
    struct entry *oldest = NULL;
    for (int i = 0; i < GUESTS_MAX; i++) {
        struct entry *entry = &guests->entries[i];
        if (entry->known && is_account(&entry->guest.account, account))
            return entry;
        if (!entry->guest.connections && (!oldest || entry->seen_ns < oldest->seen_ns))
            oldest = entry;
    }
    *oldest = (struct entry){.known = true};
    return oldest;
}

bool guest_may_request(struct guest *guest, int64_t now_ns) {
    return bucket_take(&guest->requests, WEB_REQUESTS_PER_S, WEB_REQUESTS_BURST, now_ns);
}

struct guest *guests_enter(struct guests *guests, const char *token,
                           const struct web_account *account, int64_t now_ns) {
    uint8_t *hash;
    struct entry *entry = find(guests, token, &hash);
    if (entry && !is_account(&entry->guest.account, account)) {
        memset(hash, 0, SHA256_DIGEST_LENGTH);
        entry = NULL;
    }
    if (!entry) {
        entry = place_for(guests, account);
        SHA256((const uint8_t *)token, strlen(token), entry->tokens[entry->next]);
        entry->next = (entry->next + 1) % TOKENS_EACH;
    }
    entry->guest.account = *account;
    entry->seen_ns = now_ns;
    return &entry->guest;
}
