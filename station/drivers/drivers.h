// The drivers of the table, and what several of them share.
#pragma once

#include "drivers/device.h"

#include <stdbool.h>
#include <stdint.h>

extern const struct device_driver hid_driver;
extern const struct device_driver modbus_driver;
extern const struct device_driver recorded_driver;
extern const struct device_driver simulated_driver;
extern const struct device_driver tracker_driver;

#define POLL_MAX_NS 100000000LL // the longest that a poll may wait

// Sleeps until due_ns, but no longer than POLL_MAX_NS. True: due_ns has come.
bool wait_until(int64_t due_ns);

// What was due within most_ns is not due later because the clock went back.
int64_t due_within(int64_t due_ns, int64_t most_ns);

// Adds a sample; the newest of a channel and kind in one reading is the one that counts.
void reading_put(struct device_reading *reading, const struct sample *sample);

// Adds a line; a line that is there already stays one.
void outputs_add(struct device_outputs *outputs, enum channel channel, enum sample_kind kind);
