// Where the scope goes to see: with a place in the middle of its picture, or where it turns its
// optic from one place to another.
//
// All of these append rows. RESULT_MISSING: the case has no such landmark; RESULT_INVALID: bones
// are in the way.
#pragma once

#include "motion/move.h"

// The place, or the group's planned resection, or its middle, is straight ahead, or as near to that
// as bones let, and the picture is upright.
enum result look_to(struct plan *plan, struct hand *hand, const struct motion_step *step,
                    const struct case_group *group);

// The tip goes to where either place comes nearest to the middle of the picture as the optic turns.
enum result look_stand(struct plan *plan, struct hand *hand, const struct motion_step *step,
                       const struct case_group *group);

// The optic turns about the shaft until it looks towards the place.
enum result look_turn(struct plan *plan, struct hand *hand, const struct motion_step *step,
                      const struct case_group *group);
