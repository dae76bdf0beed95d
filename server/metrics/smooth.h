// Smoothed positions of a tracked point at 100 Hz, from samples at any times. Path, speed and jerk
// are computed from them.
//
// Between two samples the point moves straight. Its mean over each cell of 10 ms (cell k: from k to
// k + 1 times 10 ms) is exact at any rate of the station. A symmetric FIR follows: six successive
// running means of SMOOTH_BOX cells. Its weights are positive, so it lengthens no path. It shifts
// no phase, and has a delay of SMOOTH_TAPS / 2 cells. It has no output until all its cells are
// known, so figures made live and from a trace are the same.
#pragma once

#include "base/pose.h"

#include <stdint.h>

#define SMOOTH_PERIOD_NS 10000000LL
#define SMOOTH_RATE_HZ 100.0
#define SMOOTH_BOX 8 // -3 dB at 2.3 Hz, below -60 dB from 10 Hz on
#define SMOOTH_TAPS (6 * (SMOOTH_BOX - 1) + 1)

// Samples farther apart than this are not joined: a new run begins, and the time between does not
// count.
#define SMOOTH_BRIDGE_NS 150000000LL
#define SMOOTH_OUT_MAX (SMOOTH_BRIDGE_NS / SMOOTH_PERIOD_NS + 1)

struct smooth {
    bool running; // there was a sample in this run: `last` at last_ns
    int64_t last_ns;
    vec3 last;
    int64_t cell; // the cell that is being filled
    bool whole;   // it is being filled from its beginning
    vec3 sum;     // position times ns so far
    vec3 cells[SMOOTH_TAPS];
    int count, next; // number of cells; index of the oldest once all are there
    bool first;      // this run has had no output yet
};

struct smooth_point {
    int64_t cell;
    bool first; // of a run
    vec3 position;
};

void smooth_init(struct smooth *smooth);
void smooth_break(struct smooth *smooth); // the next sample begins a run

// Adds a sample, and returns the number of points in out_points, in order. Ignores a sample that is
// not newer than the last one. time_ns must not be negative.
int smooth_feed(struct smooth *smooth, int64_t time_ns, vec3 position,
                struct smooth_point out_points[SMOOTH_OUT_MAX]);
