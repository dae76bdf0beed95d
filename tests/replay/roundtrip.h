// An exported image beside the record that it was made from, bit for bit.
#pragma once

#include "replay/parts.h"
#include "step/session.h"

struct roundtrip {
    uint64_t steps, jobs, landed, maps; // that were compared
    uint64_t values;                    // of them all
    uint64_t differences;               // values that are not the record's
    double largest_offset_mm;           // of S'', along an axis
};

// Every field of every step of a trace that is there as a whole.
void roundtrip_fields(const struct exr_parts *parts, const char *trace, struct roundtrip *r);

// Every blend or offset, and every displacement, after every landing, beside a replay's. The trace
// has no gap.
void roundtrip_maps(const struct exr_parts *parts, const char *trace, const struct scene *scene,
                    struct roundtrip *r);
