// Places of femur and tibia where hands reach a loose body: of one flexion and one pair of portals
// all of them. A grasper comes through the one with room for the body, and a scope through the
// other one sees it. For add_loose.c only.
#pragma once

#include "case/case.h"

struct loose_place {
    enum body body;
    vec3 at; // on the patient's surface, in the frame of the body
};

// RESULT_MISSING: the case has fewer than two portals; RESULT_INVALID: not so many such places.
enum result loose_places_find(struct knee_case *knee, vec3 radii_mm, int count,
                              struct loose_place *out_places, struct error *err);
