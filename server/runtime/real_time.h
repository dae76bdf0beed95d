// A worker at real-time priority, where the limit RTPRIO of the process grants it: no other program
// then keeps a pose waiting. A worker that is busy for most of the time goes back to normal priority meanwhile, so
// that traces, the console and other programs go on. For the worker's thread alone.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define REAL_TIME_PRIORITY 10

struct real_time {
    bool is_allowed, is_on;
    int64_t looked_ns, waited_ns; // of this look
};

// Takes the priority. False: it is not granted.
bool real_time_begin(struct real_time *real_time, int64_t now_ns);

// After each wait, with when it began. Looks ten times a second at the time that passed: above 80 %
// busy the priority goes, below 50 % it comes back.
void real_time_waited(struct real_time *real_time, int64_t begin_ns, int64_t now_ns);
