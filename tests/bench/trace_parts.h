// The parts of the bench of traces.
#pragma once

#include "bench.h"
#include "trace/trace.h"

// What a server does for 8 stations at 1 kHz, and what is lost of it where it is killed, with
// SIGKILL, at random moments. In `folder`, which is left empty.
enum result bench_trace_load(const char *folder, bool quick, struct report *report,
                             struct error *err);

// Replays a trace in other programs: differing steps of one without the optimizer, and how far
// warped poses are off where the mathematics library has another level of the CPU (with other
// events: infinite).
enum result bench_trace_unoptimized(const char *path, const char *case_dir, double *out_differences,
                                    struct error *err);
enum result bench_trace_other_cpu(const char *path, const char *case_dir, double *out_mm,
                                  struct error *err);

// Cuts the trace off at random bytes, runs what is left again, goes on with the rest of the whole
// one: steps that come out otherwise than they are recorded.
enum result bench_trace_resume(const char *path, const struct scene *scene, int times,
                               double *out_differences, struct error *err);
