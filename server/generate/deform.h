// Displaces surfaces of a case: S' from S.
#pragma once

#include "case/case.h"

// A dent: cartilage and bone that the patient has lost.
struct deform_cavity {
    vec3 at;          // rest pose, femur's frame; the first group's nearest vertex is the middle
    double radius_mm; // of the ball outside which nothing moves
    double depth_mm;  // in the middle, against the surface's normal there; at most radius_mm / 2
    bool refines;     // halves triangles that are too long for it before (generate/refine.h)
};

// Adds the dent to the `warp` of all groups given (1 or more). Points of S + warp follow one map of
// space, p − depth (1 − |p − middle|²/radius²)³ n: twice continuously differentiable and one to
// one, so that no surface folds, parts and groups that lie on one another stay as they lie, and
// dents that overlap add up. The middle moves by exactly depth_mm (to float). n is the mean normal
// of the first group within a quarter of the radius, as far as it faces as the middle does.
// RESULT_INVALID, naming the value, where a number is out of range or the first group has no vertex
// within radius_mm / 2 of `at`; nothing has changed then.
enum result deform_cavity_add(struct case_group *const *groups, int group_count,
                              const struct deform_cavity *cavity, struct error *err);
