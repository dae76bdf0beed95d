// Notices a source that shakes more than a body can, in two ways.
//
// Within a few poses: each pose is compared with where the two before it point. What a hand may add
// to that is allowed for: its acceleration, and two steps of its motion (samples that came late or
// not at all). That allows much where samples are far apart.
//
// Within NOISE_SPAN poses, at any rate from 10 Hz on: a hand's path is smooth over five poses, most
// of the time. So what the fourth differences of most poses have at the least is noise.
#pragma once

#include "base/history.h"

#include <stdbool.h>
#include <stdint.h>

#define NOISE_SPAN 30
#define NOISE_MEMORY_NS 250000000LL // after a pause it starts anew

// Zeroed: no pose yet.
struct noise {
    struct history recent;
    double score; // above 1: too much
    int next, count;
    double mm[NOISE_SPAN], rad[NOISE_SPAN]; // fourth differences, as standard deviations
};

// Takes a pose, newer than those before. True: the source shakes, with a standard deviation of more
// than limit_mm or limit_deg in each direction; true on for about ten poses after the last such
// one.
bool noise_is_high(struct noise *noise, double limit_mm, double limit_deg, int64_t time_ns, pose p);
