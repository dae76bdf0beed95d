// Is a message late? A tracker's clock is not ours, but the time between its stamp and the
// message's arrival only grows by delay: the shortest one seen is taken for no delay at all.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define STAMP_LATE_NS 100000000LL // a message older than this is not used
#define STAMP_MEMORY_NS                                                                            \
    1500000000LL // after so long with late messages only, the clock is a new one

enum stamp_verdict {
    STAMP_GOOD,
    STAMP_LATE,  // delayed, or measured long ago, or the clock was put back
    STAMP_AHEAD, // the clock was put forward, or runs fast; said once for each STAMP_LATE_NS
    STAMP_ANEW   // nothing but late messages for STAMP_MEMORY_NS: the next one counts
};

// Zeroed: no message yet.
struct stamp_clock {
    bool known;
    int64_t offset_ns;   // from stamp to arrival, at the shortest
    int64_t told_ns;     // the offset when STAMP_AHEAD was said last
    int64_t arrival_ns;  // of the newest message
    int64_t good_ns;     // of the newest one that was good
    int64_t lateness_ns; // of the newest
};

enum stamp_verdict stamp_judge(struct stamp_clock *clock, int64_t stamp_ns, int64_t arrival_ns);
