// The joint as hands move it: bones that stay in contact.
#pragma once

#include "case/case.h"
#include "case/solid.h"

// The joint's six values at a flexion and valgus (degrees). In valgus the tibia turns about the
// lateral contact, in varus about the medial one, and keeps the gap that was there before. In
// neither, the translations are 0.
struct joint_angles motion_joint(const struct knee_case *knee, const struct solid *femur,
                                 const struct solid *tibia, double flexion_deg, double valgus_deg);
