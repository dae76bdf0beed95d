#include "api/throttle.h"

#include "api/secret.h"
#include "base/check.h"
#include "base/clock.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WINDOW_NS (60 * NS_PER_S)

static uint64_t key_of(const char *who) {
    char hash[SECRET_MAX];
    secret_hash(who, hash);
    hash[16] = '\0';
    return strtoull(hash, NULL, 16) | 1; // 0: an empty place
}

static int64_t newest(const struct throttle_key *k) {
    int64_t ns = 0;
    for (int i = 0; i < THROTTLE_NAME_TRIES; i++)
        if (k->tried_ns[i] > ns)
            ns = k->tried_ns[i];
    return ns;
}

static int oldest(const struct throttle_key *k, int most) {
    int found = 0;
    for (int i = 1; i < most; i++)
        if (k->tried_ns[i] < k->tried_ns[found])
            found = i;
    return found;
}

// Its place, or NULL.
static struct throttle_key *find(struct throttle *t, uint64_t key) {
    for (int i = 0; i < THROTTLE_KEYS; i++)
        if (t->keys[i].key == key)
            return &t->keys[i];
    return NULL;
}

// If all places are taken, the one that was unused for the longest time.
static struct throttle_key *find_or_make(struct throttle *t, uint64_t key) {
    struct throttle_key *place = find(t, key);
    if (place)
        return place;
    place = &t->keys[0];
    for (int i = 1; i < THROTTLE_KEYS && place->key; i++)
        if (!t->keys[i].key || newest(&t->keys[i]) < newest(place))
            place = &t->keys[i];
    *place = (struct throttle_key){.key = key};
    return place;
}

bool throttle_try(struct throttle *t, const char *who, int most, int64_t now_ns, int *out_wait_s) {
    CHECK(most > 0 && most <= THROTTLE_NAME_TRIES);
    pthread_mutex_lock(&t->lock);
    struct throttle_key *k = find_or_make(t, key_of(who));
    int64_t *place = &k->tried_ns[oldest(k, most)];
    int64_t left_ns = *place ? *place + WINDOW_NS - now_ns : 0;
    if (left_ns <= 0)
        *place = now_ns;
    pthread_mutex_unlock(&t->lock);
    *out_wait_s = left_ns > 0 ? (int)((left_ns + NS_PER_S - 1) / NS_PER_S) : 0;
    return left_ns <= 0;
}

void throttle_take_back(struct throttle *t, const char *who, int64_t tried_ns) {
    pthread_mutex_lock(&t->lock);
    struct throttle_key *k = find(t, key_of(who));
    for (int i = 0; k && i < THROTTLE_NAME_TRIES; i++)
        if (k->tried_ns[i] == tried_ns) {
            k->tried_ns[i] = 0;
            break;
        }
    pthread_mutex_unlock(&t->lock);
}

void throttle_address(const char *address, char out_who[64]) {
    struct in6_addr six;
    char text[INET6_ADDRSTRLEN];
    if (inet_pton(AF_INET6, address, &six) != 1) {
        snprintf(out_who, 64, "address %.46s", address);
        return;
    }
    if (IN6_IS_ADDR_V4MAPPED(&six)) {
        inet_ntop(AF_INET, six.s6_addr + 12, text, sizeof text);
    } else {
        memset(six.s6_addr + 8, 0, 8);
        inet_ntop(AF_INET6, &six, text, sizeof text);
    }
    snprintf(out_who, 64, "address %s", text);
}
