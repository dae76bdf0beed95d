// The parts of `arthron-bench devices`.
#pragma once

#include "bench.h"
#include "mockup.h"
#include "samples/runner.h"

enum line {
    MODBUS_TCP,
    MODBUS_RTU,
    TRACKER,
    HID,
    MOCKUP_LINES,
    RECORDED = MOCKUP_LINES,
    SIMULATED,
    LINES
};

const char *line_name(enum line line);

// The driver that reads that line of the mock-up; `rate_hz`: of its polls where it sets their pace.
enum result line_open(const struct mockup *mockup, enum line line, double rate_hz,
                      struct runner **out_runner, struct error *err);

void sleep_until(int64_t time_ns); // on the monotonic clock

// Two slaves of one line against one alone.
enum result bench_slaves(const bool chosen[LINES], bool quick, struct report *report,
                         struct error *err);

// Trackers that are late by ten unknown times, and how well bone and tool go together then. It goes
// on beside another part; the end waits for it, and reports.
struct bench_time;
struct bench_time *bench_time_start(bool quick);
enum result bench_time_end(struct bench_time **time, struct report *report, struct error *err);

// What clients of OpenIGTLink miss of the poses that are sent to them; beside another part, too.
struct bench_out;
struct bench_out *bench_out_start(bool quick);
enum result bench_out_end(struct bench_out **out, struct report *report, struct error *err);

// Each fault that the mock-up knows, one after the other, on all lines of it that are chosen, at
// once.
enum result bench_faults(const bool chosen[LINES], bool quick, struct report *report,
                         struct error *err);
