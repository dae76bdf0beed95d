// A step of a recipe that adds loose bodies to a case: one at a place, or some at places that hands
// reach.
#pragma once

#include "case/case.h"

struct add_loose {
    enum body body;               // BODY_COUNT: none is given
    vec3 at;                      // from the joint's origin: x lateral, y anterior, z proximal
    char landmark[CASE_NAME_MAX]; // of the body, in place of `at`; empty: none
    bool has_at;
    int count;     // 0: one, at the place
    vec3 radii_mm; // half axes; it lies on the side of the last
};

void add_loose_init(struct add_loose *step);

// As pathology_take and pathology_check.
enum result add_loose_take(struct add_loose *step, const char *key, const char *value,
                           struct error *err);
enum result add_loose_check(const struct add_loose *step, struct error *err);

// Adds the loose body NAME at the surface point of femur or tibia nearest to the place, or NAME_1,
// NAME_2, ... where a shaft comes to them through a portal with room for the body, and a scope
// through another one sees them, at one flexion. As pathology_apply.
enum result add_loose_apply(struct knee_case *knee, const char *name, const struct add_loose *step,
                            struct error *err);
