#include "api/tally.h"

#include "api/secret.h"
#include "base/clock.h"

#include <limits.h>
#include <stdlib.h>

#define HOUR_NS (3600 * NS_PER_S)

static uint64_t tally_key_of(const char *what) {
    char hash[SECRET_MAX];
    secret_hash(what, hash);
    hash[16] = '\0';
    return strtoull(hash, NULL, 16) | 1; // 0: an empty place
}

// Its place; else an empty one, or the one whose hour began first.
static struct tally_key *find_or_make_tally(struct tally *t, uint64_t key, int64_t now_ns) {
    struct tally_key *place = &t->keys[0];
    for (int i = 0; i < TALLY_KEYS; i++) {
        if (t->keys[i].key == key)
            return &t->keys[i];
        if (place->key && (!t->keys[i].key || t->keys[i].since_ns < place->since_ns))
            place = &t->keys[i];
    }
    *place = (struct tally_key){.key = key, .since_ns = now_ns};
    return place;
}

int tally_add(struct tally *t, const char *what, int64_t now_ns) {
    uint64_t key = tally_key_of(what);
    pthread_mutex_lock(&t->lock);
    struct tally_key *k = find_or_make_tally(t, key, now_ns);
    if (now_ns - k->since_ns >= HOUR_NS)
        *k = (struct tally_key){.key = key, .since_ns = now_ns};
    k->count += k->count < INT_MAX;
    int count = k->count;
    pthread_mutex_unlock(&t->lock);
    return count;
}

bool tally_is_told(int count) {
    return (count & (count - 1)) == 0;
}
