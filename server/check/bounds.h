// What a knee can be like: one table of bounds, each with its source.
#pragma once

#include "check/inspect.h"

enum bound_id {
    BOUND_CONDYLES,
    BOUND_PLATEAU,
    BOUND_MENISCUS_VOLUME,
    BOUND_PATELLA_HEIGHT,
    BOUND_PATELLA_WIDTH,
    BOUND_PATELLA_ASIDE,
    BOUND_PATELLA_ABOVE,
    BOUND_ORIGIN,
    BOUND_BONES_OVERLAP,
    BOUND_MENISCUS_OVERLAP,
    BOUND_TIBIA_GAP,
    BOUND_PATELLA_GAP,
    BOUND_MENISCUS_TIBIA_GAP,
    BOUND_MENISCUS_FEMUR_GAP,
    BOUND_COUNT
};

// A value beyond `least` or `most` is a warning, and one beyond `fault_least` or `fault_most` a
// fault. A side without a bound is infinite.
struct bound {
    const char *what, *unit;
    double fault_least, least, most, fault_most;
    const char *source;
};

const struct bound *bound_of(enum bound_id id);

// FINDING_NOTE within the bound. A value that is not a number is a fault.
enum finding_level bound_level(enum bound_id id, double value);

// "9.1 mm high; a patella is 25 to 60 mm high (source)", for a value beyond the bound.
void bound_text(enum bound_id id, double value, char *out, size_t size);

// Adds a finding with that text; nothing for a value within the bound.
void bound_inspect(struct inspection *inspection, enum bound_id id, const char *where,
                   double value);
