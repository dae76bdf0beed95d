// Counts events of the last hour by a key, so that the audit log and the server's log tell of them
// without an entry for each. Any thread may call.
#pragma once

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#define TALLY_KEYS 1024

// Zero, except for the lock, is a valid start.
struct tally {
    pthread_mutex_t lock;
    struct tally_key {
        uint64_t key; // 0: an empty place
        int count;
        int64_t since_ns;
    } keys[TALLY_KEYS];
};

// Counts an event, and returns how many there were in the hour that began with the first. now_ns:
// monotonic.
int tally_add(struct tally *tally, const char *what, int64_t now_ns);

// Whether to tell of the event with this number in its hour: 1, 2, 4, 8, ...
bool tally_is_told(int count);
