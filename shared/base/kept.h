// State that a program keeps in memory or in a file and takes back later. One function a struct
// serves both ways, so that what is written and what is read cannot differ. Only the same program
// reads it: numbers are as they are in memory.
#pragma once

#include "base/pose.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct kept {
    uint8_t *data;
    size_t size, used;
    bool reads; // what is there into the caller's values; else the values into what is there
    bool grows; // `data` is allocated and grows; else it has a size
    bool bad;   // no room, nothing left, or a value out of its range. From then on nothing is
                // written, and zeros are read
};

struct kept kept_into(uint8_t *data, size_t size); // writes into the caller's memory
struct kept kept_growing(void);                    // writes; the caller frees `data`
struct kept kept_from(const uint8_t *data, size_t size);

static inline size_t kept_left(const struct kept *k) { // that can be read
    return k->reads && !k->bad ? k->size - k->used : 0;
}

void kept_bytes(struct kept *k, void *bytes, size_t size); // whatever they are
void kept_flag(struct kept *k, bool *flag);
void kept_int(struct kept *k, int *value, int least, int most);
void kept_count(struct kept *k, uint32_t *count, uint32_t most);
void kept_u64(struct kept *k, uint64_t *value);
void kept_time(struct kept *k, int64_t *time_ns);                         // of about 73 years
void kept_real(struct kept *k, double *value, double least, double most); // no NaN
void kept_point(struct kept *k, vec3 *point); // finite, within KEPT_FAR_MM
void kept_pose(struct kept *k, pose *p);      // too; its rotation of about unit length
#define KEPT_FAR_MM 1e6

// An array of so many: writes it; or allocates and reads one. NULL where it is empty or bad.
void *kept_array(struct kept *k, const void *array, size_t count, size_t size);

// What was read is only good under a condition.
static inline void kept_holds(struct kept *k, bool condition) {
    k->bad |= k->reads && !condition;
}
