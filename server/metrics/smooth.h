// Positions of a tracked point at 100 Hz and without noise, from samples at any times: what path,
// speed and jerk are taken from.
//
// Between two samples the point goes straight. Its mean over each cell of 10 ms (cell k: from k to
// k + 1 times 10 ms) is exact, whatever the station's rate. A symmetric FIR follows: six running
// means of SMOOTH_BOX cells, one after the other, so its weights are positive (a path never gets
// longer) and it has no phase, only a delay of SMOOTH_TAPS / 2 cells. It says nothing before all
// its cells are there, so figures made live and from a record are the same.
#pragma once

#include "base/pose.h"

#include <stdint.h>

#define SMOOTH_PERIOD_NS 10000000LL
#define SMOOTH_RATE_HZ 100.0
#define SMOOTH_BOX 8 // -3 dB at 2.3 Hz, below -60 dB from 10 Hz on
#define SMOOTH_TAPS (6 * (SMOOTH_BOX - 1) + 1)

// Samples farther apart than this are not joined: another run begins, and what lay between counts
// for nothing.
#define SMOOTH_BRIDGE_NS 150000000LL
#define SMOOTH_OUT_MAX (SMOOTH_BRIDGE_NS / SMOOTH_PERIOD_NS + 1)

struct smooth {
    bool running; // there was a sample in this run: `last` at last_ns
    int64_t last_ns;
    vec3 last;
    int64_t cell; // that is being filled
    bool whole;   // from its beginning
    vec3 sum;     // position times ns so far
    vec3 cells[SMOOTH_TAPS];
    int count, next; // how many of them are there; the oldest, where all are
    bool first;      // nothing came out of this run yet
};

struct smooth_point {
    int64_t cell;
    bool first; // of a run
    vec3 position;
};

void smooth_init(struct smooth *smooth);
void smooth_break(struct smooth *smooth); // the next sample begins a run

// What comes out, in order; how many. A sample that is not newer than the last one is left out.
// time_ns is not below 0.
int smooth_feed(struct smooth *smooth, int64_t time_ns, vec3 position,
                struct smooth_point out_points[SMOOTH_OUT_MAX]);
