// Counts samples and dropouts of a station's devices. The worker counts, any thread may read.
#pragma once

#include "base/sample.h"
#include "wire/wire.h"

#include <stdatomic.h>

// Since the station's connection.
struct device_counts {
    atomic_uint_fast64_t samples;  // frames with a new measurement of the device
    atomic_uint_fast64_t dropouts; // how often a sample of the device went from ok to held
    atomic_bool lost;              // all of its samples are lost
};

// The samples of the last frame, for the worker.
struct device_watch {
    int64_t newest_ns[WIRE_DEVICES_MAX];
    enum validity validity[CHANNEL_COUNT][SAMPLE_KIND_COUNT]; // ok at first
};

void devices_begin(struct device_watch *watch, struct device_counts counts[WIRE_DEVICES_MAX]);

// frame: a valid one, on the station's clock.
void devices_step(struct device_watch *watch, const struct frame *frame,
                  struct device_counts counts[WIRE_DEVICES_MAX]);
