// How much later a tool's poses come than the joint's angles: by moving both, as where the tool is
// fixed to the bone that moves. The tool then turns as the joint bends, and the delay is the one at
// which the turn tells the flexion best.
#pragma once

#include "base/pose.h"
#include "base/result.h"

#include <stdint.h>

#define DELAY_LEAST_MS (-100) // the joint may be the late one
#define DELAY_MOST_MS 300

struct delay_flexion {
    int64_t time_ns; // rises
    double deg;
};

struct delay_turn {
    int64_t time_ns; // rises
    quat rotation;   // of the tool, in any frame that stands still
};

struct delay_fit {
    double delay_ms;               // of the tool behind the joint
    double uncertainty_ms;         // standard deviation
    double residual_deg;           // of the flexion, root mean square, at this delay
    double range_deg, speed_deg_s; // of the flexion; root mean square of its speed
};

// RESULT_MISSING: too few samples, or the two have no time in common. RESULT_INVALID: the motion
// cannot tell the delay to 1 ms, or the tool does not turn with the joint; the error says which,
// and *out has what was found.
enum result delay_calibrate(const struct delay_flexion *flexions, int flexion_count,
                            const struct delay_turn *turns, int turn_count, struct delay_fit *out,
                            struct error *err);
