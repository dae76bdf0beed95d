// A tracker's clock is not ours, but the time between a message's stamp and its arrival only grows
// by delay: the shortest one seen is taken for no delay at all. So a late message is known, and so
// is the time at which it was measured, whatever the jitter of its way.
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

#define STAMP_FIT_SECONDS 60

// Offset and drift of the other clock: the line below the shortest ways of the last seconds that is
// nearest to them all (S. B. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew
// from network delay measurements", INFOCOM 1999).
struct stamp_fit {
    struct stamp_way {
        int64_t stamp_ns, offset_ns; // from stamp to arrival
    } ways[STAMP_FIT_SECONDS];       // the shortest of each second, a ring
    int count, next;
    struct stamp_way least; // of the second that goes on
    int64_t second_end_ns;  // on the other clock
    struct stamp_way line;  // a point of it
    double slope;
};

// Zeroed: a connection begins.
struct stamp_trial {
    int64_t begin_ns, arrival_ns, gap_ns; // gap_ns: the longest between two messages
    int count, bad;
};

// Zeroed: no message yet.
struct stamp_clock {
    bool known;
    int64_t offset_ns;   // from stamp to arrival, at the shortest
    int64_t told_ns;     // the offset when STAMP_AHEAD was said last
    int64_t arrival_ns;  // of the newest message
    int64_t good_ns;     // of the newest one that was good
    int64_t lateness_ns; // of the newest
    struct stamp_fit fit;
    int64_t told_stamp_ns, told_time_ns; // of the newest time that was told; 0: none
};

enum stamp_verdict stamp_judge(struct stamp_clock *clock, int64_t stamp_ns, int64_t arrival_ns);

// True: of the last seconds' messages, which came regularly, two of three were not good. The stamps tell no
// time then: they are in another unit, or run at another pace.
bool stamp_is_no_clock(struct stamp_trial *trial, enum stamp_verdict verdict, int64_t arrival_ns);

// When a message that was judged good was measured, on our clock: its stamp, by the fitted offset
// and drift. What no message tells is left in it: the shortest way (a device's delay_ms). Not after
// its arrival; later than a former one wherever its stamp is.
int64_t stamp_time(struct stamp_clock *clock, int64_t stamp_ns, int64_t arrival_ns);
