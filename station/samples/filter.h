// The one-euro filter (Casiez, Roussel and Vogel, CHI 2012): a low-pass whose cut-off rises with
// speed, so that a resting hand does not shake and a moving one is not late.
//
//   cut-off = MIN_CUTOFF_HZ + BETA · speed
//
// The speed, itself smoothed at DCUTOFF_HZ, is in mm/s for lengths, in degrees/s for rotations and
// angles, in percent/s for openings, in N/s for forces. One cut-off serves all directions, so that
// the result does not depend on how the axes lie. Buttons are not filtered.
//
// A low-pass with cut-off f lags behind a steady motion by 1 / (2 pi f): that is the latency which
// is stated in the sample.
#pragma once

#include "base/sample.h"

#include <stdbool.h>
#include <stdint.h>

struct filter_settings {
    enum filter_kind kind;
    double min_cutoff_hz, beta, dcutoff_hz;
};

// "none", or "one-euro MIN_CUTOFF_HZ BETA [DCUTOFF_HZ]": 0.01 to 1000, 0 to 1000, 0.01 to 1000
// (absent: 1). False where it is neither.
bool filter_parse(const char *text, struct filter_settings *out_settings);

const char *filter_name(enum filter_kind kind); // "none", "one-euro"

// Of one channel. Zeroed: none.
struct filter {
    struct filter_settings settings;
    int64_t time_ns;             // of the newest sample; 0: the next one is the first
    struct sample raw, smoothed; // the newest
    vec3 speeds[2];              // of the lengths, and of the angles, percent or newtons
    double latency_s;            // that it adds now; 0 after the first sample
};

void filter_init(struct filter *filter, const struct filter_settings *settings);

// Takes a sample, newer than those before, and puts the filtered value, the filter's kind and its
// latency in. After a pause of FILTER_MEMORY_NS it starts anew: the first sample stays as it is.
#define FILTER_MEMORY_NS 250000000LL
void filter_apply(struct filter *filter, struct sample *sample);
