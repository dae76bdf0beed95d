// A dent of a bone: cartilage and bone that the patient has lost.
#pragma once

#include "case/case.h"

struct cavity {
    char name[CASE_NAME_MAX];
    enum body body;   // the group of that name is dented
    vec3 at;          // rest pose; the bone's closest point is the middle
    double radius_mm; // of the ball outside which nothing moves
    double depth_mm;  // in the middle, against the surface's mean normal; at most radius_mm / 2
};

// Adds the dent to the displacements (warp) of all groups of the body. They follow one smooth,
// one-to-one map of space, so facing surfaces (a meniscus and its tibia) stay as clear of one
// another as they were. RESULT_INVALID where the bone is farther from `at` than half the radius.
enum result cavity_add(struct knee_case *knee, const struct cavity *cavity, struct error *err);
