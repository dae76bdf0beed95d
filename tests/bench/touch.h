// Touch where sight is: cuts into the meniscus of a knee, and S'' put onto what they leave
// (match/conform.h), measured.
#pragma once

#include "bench.h"
#include "samples.h"

struct touch_worst {
    double share_bites, share_resections; // mismatch over what was cut
    double surface_p95_mm;
    double crossings; // of S'' with itself, where S' has none
    double error;     // of the volume, over the whole
    struct samples ms;
};

// Adds the scenes' figures to the report. Without a case on the command line, the generated knee.
enum result touch_measure(const struct bench_options *options, struct report *report,
                          struct touch_worst *out_worst, struct error *err);
