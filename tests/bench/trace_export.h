// What is made from a record for others, how fast, and whether it is the same.
#pragma once

#include "bench.h"
#include "step/session.h"

// The trace's folder gets files that are gone again.
enum result bench_export(const char *trace, const struct scene *scene, struct report *report,
                         struct error *err);
