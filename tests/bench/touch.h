// Touch where sight is: cuts into the meniscus of a knee, and S'' put onto what they leave
// (match/conform.h), measured.
#pragma once

#include "bench.h"

enum scene_kind {
    SCENE_BITES,   // fifteen
    SCENE_THROUGH, // fifteen, then a section of the meniscus; what lies behind it comes off
    SCENE_RESECTION,
    SCENE_KINDS
};

struct touch_worst {
    double share[SCENE_KINDS];    // mismatch over what was cut
    double surface_p95_mm, error; // of all but SCENE_THROUGH; error of the volume, over the whole
    double crossings;             // of S'' with itself, where S' has none
    double p50_ms;                // of fits: fine generated menisci, and those of cases
};

// Adds the scenes' figures to the report. Without a case on the command line, the generated knee.
enum result touch_measure(const struct bench_options *options, struct report *report,
                          struct touch_worst *out_worst, struct error *err);
