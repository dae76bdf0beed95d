// Limits tries of one kind: a few are free, and then each one lengthens the wait for the next. Any
// thread may call.
#pragma once

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#define THROTTLE_KEYS 4096

// The first try behind the free ones waits first_s, the next twice as long, up to most_s. All are
// forgotten after twice most_s, and at least a minute, without a try.
struct throttle_rule {
    int free, first_s, most_s;
};

// Zero, except for the lock, is a valid start.
struct throttle {
    pthread_mutex_t lock;
    struct throttle_key {
        uint64_t key; // 0: an empty place
        int count;
        int64_t last_ns, before_ns; // of the last two tries
    } keys[THROTTLE_KEYS];
};

// Counts a try by `who` ("name ada") until throttle_take_back. False if it is too early: then it
// does not count, and *out_wait_s is the time to wait. now_ns: monotonic.
bool throttle_try(struct throttle *throttle, const char *who, const struct throttle_rule *rule,
                  int64_t now_ns, int *out_wait_s);
// now_ns: that of the try.
void throttle_take_back(struct throttle *throttle, const char *who, int64_t now_ns);

// The same question without counting.
bool throttle_may(struct throttle *throttle, const char *who, const struct throttle_rule *rule,
                  int64_t now_ns, int *out_wait_s);

// The `who` of an address: the IPv4 address, or the IPv6 network of 64 bits. is_near: the address,
// as in base/source.h.
void throttle_address(const char *address, bool is_near, char out_who[64]);
