// What an illusion has to show, on any knee: the scenes of `arthron-bench fidelity`.
#pragma once

#include "case/case.h"

enum lesion {
    LESION_CAVITY,         // 3 mm deep in the medial plateau, in front of the contact
    LESION_UNDER_MENISCUS, // 3 mm deep below the medial meniscus, which sinks with it
    LESION_BUMP,           // 1.5 mm high on the femur, where there is room for it
    LESION_TRIMMED,        // the medial meniscus after a cut: a part of its maxcut, matched
    LESION_NOTCH,          // an osteophyte of 2 mm on the roof of the femur's notch
    LESION_COUNT
};

const char *lesion_name(enum lesion lesion);

// Whether a group is displaced that is hollow, a meniscus or the femur with its notch, so that
// closest points jump: what `smooth` is for.
bool lesion_is_concave(enum lesion lesion);

// All displacements of the case are replaced by the lesion's. Its place, within 3 mm, and its
// size, within a tenth, come from the seed. RESULT_MISSING: the knee has no such place, no medial
// meniscus or no maxcut of it.
enum result lesion_make(struct knee_case *knee, enum lesion lesion, uint64_t seed,
                        struct error *err);
