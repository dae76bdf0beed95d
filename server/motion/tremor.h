// The tremor of a hand: noise of 8 to 12 Hz in each direction, the same for one seed.
#pragma once

#include "base/pose.h"

#include <stdint.h>

#define TREMOR_WAVES 8

struct tremor {
    double amplitude;                  // of each wave, mm
    double frequency[3][TREMOR_WAVES]; // Hz; for x, y, z
    double phase[3][TREMOR_WAVES];     // radians
};

// rms_mm: root mean square of the displacement.
void tremor_init(struct tremor *tremor, double rms_mm, uint64_t seed);
vec3 tremor_at(const struct tremor *tremor, double t_seconds);
