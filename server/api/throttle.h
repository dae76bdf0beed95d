// How often somebody may be wrong within a minute. From any threads.
//
// An address has few tries, whatever names it tries them on. A name has more, from all addresses
// together: so few that guessing from many of them does not pay, and so many that nobody at one
// address keeps the name's owner out.
#pragma once

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#define THROTTLE_ADDRESS_TRIES 5
#define THROTTLE_NAME_TRIES 30
#define THROTTLE_KEYS 4096

// Zeroed but for the lock, it knows of nothing wrong.
struct throttle {
    pthread_mutex_t lock;
    struct throttle_key {
        uint64_t key;
        int64_t tried_ns[THROTTLE_NAME_TRIES]; // 0: not yet
    } keys[THROTTLE_KEYS];
};

// A try by `who` ("name ada"), which counts as wrong until throttle_take_back says otherwise. False
// where there were `most` (at most THROTTLE_NAME_TRIES, of one the same each time) within a minute;
// *out_wait_s says how long to wait then. now_ns: monotonic, above 0.
bool throttle_try(struct throttle *throttle, const char *who, int most, int64_t now_ns,
                  int *out_wait_s);
void throttle_take_back(struct throttle *throttle, const char *who, int64_t tried_ns);

// Of an address as texts say it, what one person may have: it itself, or of IPv6 its network of 64
// bits.
void throttle_address(const char *address, char out_who[64]);
