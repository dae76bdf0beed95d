// The newest sample of each channel and kind. What is lost keeps its last good value.
#pragma once

#include "base/clock.h"
#include "step/input.h"

#define SAMPLES_LATE_MAX_NS NS_PER_S // that a device may tell what it measured

struct samples {
    struct sample newest[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
    int64_t since_ns[CHANNEL_COUNT][SAMPLE_KIND_COUNT]; // from then on the hold counts
    bool known[CHANNEL_COUNT][SAMPLE_KIND_COUNT];       // there was ever one
};

// When a frame is taken. Times are on one clock.
struct sampling {
    int64_t now_ns;
    int64_t closed_ns; // the frame
    int64_t hold_ns;
    // The hold counts from the last frame in which the station called the sample ok; what is
    // measured SAMPLES_LATE_MAX_NS and the hold before its frame is lost. Else the hold counts from
    // when the sample was measured.
    bool from_frame;
};

// These two return events. They declare lost what the hold is over for.
uint32_t samples_take(struct samples *samples, const struct sample *sample, struct sampling at);
uint32_t samples_age(struct samples *samples, int64_t now_ns, int64_t hold_ns);

bool samples_are_lost(const struct samples *samples); // all that were ever known

// NULL: there was never one.
const struct sample *samples_last(const struct samples *samples, enum channel channel,
                                  enum sample_kind kind);
