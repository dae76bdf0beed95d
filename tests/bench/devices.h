// The parts of `arthron-bench devices`.
#pragma once

#include "bench.h"
#include "device/runner.h"
#include "mockup.h"

enum result runner_of(const char *name, const struct device_option *options, int count,
                      struct runner **out_runner, struct error *err);

void sleep_until(int64_t time_ns); // on the monotonic clock

// Each fault that the mock-up knows, one after the other, on all lines at once.
enum result bench_faults(bool quick, struct report *report, struct error *err);
