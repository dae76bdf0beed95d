// Runs all devices of a station, each in a thread of its own, and keeps the newest sample of every
// channel where the station's loop can take it without ever waiting for a device.
//
// Keys of every device's section that belong to the runner; all others are the driver's:
//   driver   the driver's name; required
//   delay_ms how long a value is on its way from the measurement to the station; 0
//   hold_ms  how long the last value of a silent channel is held before it is lost; 100
//   jump_mm  a pose that lies farther by this than a hand comes since the last ones is not used
//            (samples/guard.h); 15
//   jump_deg the same for rotations and joint angles; 15
//   noise_mm, noise_deg  values of a source that shakes more than this (standard deviation) are not
//            used (samples/noise.h); 2, 2
//   filter   none, or one-euro MIN_CUTOFF_HZ BETA [DCUTOFF_HZ] (samples/filter.h); none
//
// A channel is OK while values come, HELD from the moment that it is silent (twice its usual
// interval without a value, or the source or the guard said no), LOST hold_ms later. A channel that
// has never given a value is LOST, with a neutral value and time 0.
#pragma once

#include "base/result.h"
#include "base/sample.h"
#include "drivers/device.h"

#include <stdbool.h>
#include <stdint.h>

#define RUNNER_DEVICES_MAX 16

struct runner;

struct device_status {
    char name[DEVICE_NAME_MAX];
    const char *driver;
    bool connected;
    double rate_hz; // readings a second, over the last second
    double hold_ms; // as the config says
    enum filter_kind filter;
    double filter_latency_ms; // that it adds now; the largest of the device's channels
    uint64_t readings;        // polls that brought values
    uint64_t timeouts;        // polls that brought nothing in time
    uint64_t malformed;       // messages or values that were not what they should be
    uint64_t skipped;         // messages of types that do not concern us
    uint64_t jumps;           // poses that the guard did not let through
    uint64_t noisy;           // values of a source that shakes (samples/noise.h)
    uint64_t losses;          // channels that went from held to lost
    uint64_t reopenings;      // connections after the first one
    uint64_t markers;         // edges of its marker.NAME keys
    uint64_t markers_lost;    // of these: more than 20 a second, or than the loop takes
    char problem[sizeof((struct error *)0)->text]; // the newest one; empty while all is well
};

// Checks the configs and starts a thread for each device; a device that does not answer yet is no
// error. Refused, with the device and the key named: an unknown driver or key, a value out of
// range, two devices of one name, two that give the same channel and kind, more than
// RUNNER_DEVICES_MAX devices or FRAME_SAMPLES_MAX channels. The configs are not kept.
enum result runner_create(const struct device_config *configs, int count,
                          struct runner **out_runner, struct error *err);

// Ends all threads (within about a second) and frees. NULL inside is fine; *runner becomes NULL.
void runner_destroy(struct runner **runner);

// Fills an empty frame: every channel with its validity at now_ns (clock_now_ns()). Poses and joint
// angles that are OK are all of one time, the newest that each of them has a sample of: what came
// sooner is taken from its past (samples/past.h). Handles, and what is held or lost, are the
// newest. A sample's `device` is the index of the config. The frame's number and time are the
// caller's. Not for two threads at once.
void runner_collect(struct runner *runner, int64_t now_ns, struct frame *frame);

// The age that this added to the newest sample of a channel in the last frame, at most; ms.
double runner_alignment_ms(const struct runner *runner);

// Appends the newest sample of every channel, each of its own time.
void runner_newest(struct runner *runner, int64_t now_ns, struct frame *frame);

// The next marker of any device, with the time at which it was measured, and neither run nor
// number. False: there is none. Not for two threads at once.
bool runner_next_marker(struct runner *runner, struct marker *out_marker);
bool runner_has_markers(const struct runner *runner); // any device may give some

int runner_count(const struct runner *runner);
void runner_status(struct runner *runner, int index, struct device_status *out_status);
