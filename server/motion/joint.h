// The joint as hands move it: bones that stay in contact.
#pragma once

#include "case/case.h"
#include "mesh/solid.h"

// How hands hold a joint that otherwise is at rest: on the rest path of the case, or on the joint's
// axes where it has none. All but the flexion counts from there.
struct joint_hold {
    double flexion_deg;
    double valgus_deg;   // negative: varus
    double internal_deg; // negative: external
    double drawer_mm;    // the tibia forward; negative: backward
};

// The joint's six values. In valgus the tibia turns about the lateral contact, in varus about the
// medial one, and keeps the gap that was there before. Then it turns about its axis and glides, and
// goes as far away from the femur, or back, as keeps the least gap of the bones. With nothing but
// flexion they are case_rest's.
struct joint_angles motion_joint(const struct knee_case *knee, const struct solid *femur,
                                 const struct solid *tibia, const struct joint_hold *hold);

// `to`, and away from the femur along the tibia's axis as far as it takes for a group of the tibia
// to come no nearer to it than in `from`: T_femur_tibia all.
pose motion_clear(const struct knee_case *knee, const struct mesh *femur, const struct solid *group,
                  pose from, pose to);
