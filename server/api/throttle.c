#include "api/throttle.h"

#include "api/secret.h"
#include "base/check.h"
#include "base/clock.h"

#include <arpa/inet.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FORGET_S 60

static uint64_t throttle_key_of(const char *who) {
    char hash[SECRET_MAX];
    secret_hash(who, hash);
    hash[16] = '\0';
    return strtoull(hash, NULL, 16) | 1; // 0: an empty place
}

static struct throttle_key *find_key(struct throttle *t, uint64_t key) {
    for (int i = 0; i < THROTTLE_KEYS; i++)
        if (t->keys[i].key == key)
            return &t->keys[i];
    return NULL;
}

static bool is_less(const struct throttle_key *a, const struct throttle_key *b) {
    if (!a->key || !b->key)
        return !a->key && b->key;
    return a->count != b->count ? a->count < b->count : a->last_ns < b->last_ns;
}

// If all places are taken, that of the fewest tries: many new keys do not push out one that waits.
static struct throttle_key *find_or_make_key(struct throttle *t, uint64_t key) {
    struct throttle_key *place = find_key(t, key);
    if (place)
        return place;
    place = &t->keys[0];
    for (int i = 1; i < THROTTLE_KEYS; i++)
        if (is_less(&t->keys[i], place))
            place = &t->keys[i];
    *place = (struct throttle_key){.key = key};
    return place;
}

static int64_t forget_ns(const struct throttle_rule *rule) {
    int s = 2 * rule->most_s;
    return (s > FORGET_S ? s : FORGET_S) * NS_PER_S;
}

static int64_t wait_ns(const struct throttle_rule *rule, int count) {
    if (count < rule->free)
        return 0;
    int64_t s = rule->first_s;
    for (int i = rule->free; i < count && s < rule->most_s; i++)
        s *= 2;
    return (s < rule->most_s ? s : rule->most_s) * NS_PER_S;
}

// How long is left until the next try; 0: none.
static int64_t left_ns(struct throttle_key *k, const struct throttle_rule *rule, int64_t now_ns) {
    if (k->count > 0 && now_ns - k->last_ns >= forget_ns(rule))
        k->count = 0;
    int64_t left = k->count > 0 ? k->last_ns + wait_ns(rule, k->count) - now_ns : 0;
    return left > 0 ? left : 0;
}

static bool is_allowed(struct throttle *t, const char *who, const struct throttle_rule *rule,
                       int64_t now_ns, bool counts, int *out_wait_s) {
    CHECK(rule->free > 0 && rule->first_s > 0 && rule->most_s >= rule->first_s);
    uint64_t key = throttle_key_of(who);
    pthread_mutex_lock(&t->lock);
    struct throttle_key *k = counts ? find_or_make_key(t, key) : find_key(t, key);
    int64_t left = k ? left_ns(k, rule, now_ns) : 0;
    if (counts && !left) {
        k->count += k->count < INT_MAX;
        k->before_ns = k->last_ns;
        k->last_ns = now_ns;
    }
    pthread_mutex_unlock(&t->lock);
    *out_wait_s = (int)((left + NS_PER_S - 1) / NS_PER_S);
    return !left;
}

bool throttle_try(struct throttle *t, const char *who, const struct throttle_rule *rule,
                  int64_t now_ns, int *out_wait_s) {
    return is_allowed(t, who, rule, now_ns, true, out_wait_s);
}

bool throttle_may(struct throttle *t, const char *who, const struct throttle_rule *rule,
                  int64_t now_ns, int *out_wait_s) {
    return is_allowed(t, who, rule, now_ns, false, out_wait_s);
}

void throttle_take_back(struct throttle *t, const char *who, int64_t now_ns) {
    uint64_t key = throttle_key_of(who);
    pthread_mutex_lock(&t->lock);
    struct throttle_key *k = find_key(t, key);
    if (k && k->count > 0)
        k->count--;
    if (k && k->last_ns == now_ns)
        k->last_ns = k->before_ns;
    pthread_mutex_unlock(&t->lock);
}

void throttle_address(const char *address, bool is_near, char out_who[64]) {
    struct in6_addr six;
    char text[INET6_ADDRSTRLEN];
    if (inet_pton(AF_INET6, address, &six) != 1) {
        snprintf(out_who, 64, "address %.46s", address);
        return;
    }
    if (IN6_IS_ADDR_V4MAPPED(&six)) {
        inet_ntop(AF_INET, six.s6_addr + 12, text, sizeof text);
    } else {
        if (!is_near)
            memset(six.s6_addr + 8, 0, 8);
        inet_ntop(AF_INET6, &six, text, sizeof text);
    }
    snprintf(out_who, 64, "address %s", text);
}
