// Limits failed sign-ins within a minute. Any thread may call.
//
// An address has few tries, for all names together. A name has more, from all addresses together:
// few enough to make guessing from many addresses useless, and more than one address can use up, so
// that it cannot lock the owner of the name out.
#pragma once

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#define THROTTLE_ADDRESS_TRIES 5
#define THROTTLE_NAME_TRIES 30
#define THROTTLE_KEYS 4096

// Zero, except for the lock, is a valid start.
struct throttle {
    pthread_mutex_t lock;
    struct throttle_key {
        uint64_t key;
        int64_t tried_ns[THROTTLE_NAME_TRIES]; // 0: not yet
    } keys[THROTTLE_KEYS];
};

// Counts a try by `who` ("name ada") as failed until throttle_take_back. False if there were `most`
// within a minute: then *out_wait_s is the time to wait. most: at most THROTTLE_NAME_TRIES, and the
// same for each call with one `who`. now_ns: monotonic, above 0.
bool throttle_try(struct throttle *throttle, const char *who, int most, int64_t now_ns,
                  int *out_wait_s);
void throttle_take_back(struct throttle *throttle, const char *who, int64_t tried_ns);

// The `who` of an address: the IPv4 address, or the IPv6 network of 64 bits.
void throttle_address(const char *address, char out_who[64]);
