// The newest sample of each channel and kind. What is lost keeps its last good value.
#pragma once

#include "step/input.h"

struct samples {
    struct sample newest[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
    bool known[CHANNEL_COUNT][SAMPLE_KIND_COUNT]; // there was ever one
};

// These two return events. A sample older than hold_ns is lost.
uint32_t samples_take(struct samples *samples, const struct sample *sample, int64_t now_ns,
                      int64_t hold_ns);
uint32_t samples_age(struct samples *samples, int64_t now_ns, int64_t hold_ns);

// NULL: there was never one.
const struct sample *samples_last(const struct samples *samples, enum channel channel,
                                  enum sample_kind kind);
