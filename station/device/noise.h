// Notices a source that shakes more than a body can: each pose is compared with where the two
// before it point. What a hand may add to that is allowed for: its acceleration, and two steps of
// its motion (samples that came late or not at all).
#pragma once

#include "base/history.h"

#include <stdbool.h>
#include <stdint.h>

#define NOISE_MEMORY_NS 250000000LL // after a pause it starts anew

// Zeroed: no pose yet.
struct noise {
    struct history recent;
    double score; // above 1: too much
};

// Takes a pose, newer than those before. True: the source shakes, with a standard deviation of more
// than limit_mm or limit_deg in each direction; true on for about ten poses after the last such
// one.
bool noise_is_high(struct noise *noise, double limit_mm, double limit_deg, int64_t time_ns, pose p);
