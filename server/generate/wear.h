// Worn cartilage: how the joint's surfaces look in arthrosis. No shape changes.
#pragma once

#include "case/case.h"

// Around its middle the cartilage has this grade (CASE_WEAR_MOST). From half of the radius outwards
// the grade falls smoothly to 0, as whole cartilage is worn from the middle outwards.
struct wear_patch {
    vec3 at; // rest pose, frame of the body; the first group's nearest vertex is the middle
    double radius_mm;
    double grade; // above 0, at most CASE_WEAR_MOST
};

// Raises the `wear` of these groups (1 or more) of one body where they wear (case_group_wears),
// never lowers it. RESULT_INVALID where the first group has no vertex within radius_mm / 2 of `at`,
// RESULT_MISSING where nothing in the patch wears and shows; nothing has changed then.
enum result wear_add(struct case_group *const *groups, int group_count,
                     const struct wear_patch *patch, struct error *err);
