// Ways between targets, round the bones. A shaft is a straight line through its portal: where a tip
// is clear, so is every place between it and the portal. So each way retreats along the shaft,
// turns in the portal as deep inside as the bones let, and goes in straight.
//
// All of these append rows; RESULT_INVALID where an instrument would run through a bone: the error
// names portal and bone.
#pragma once

#include "motion/move.h"

enum result plan_enter(struct plan *plan, struct hand *hand); // along the portal's direction
enum result plan_turn(struct plan *plan, struct hand *hand, vec3 to_direction); // in the portal
enum result plan_reach(struct plan *plan, struct hand *hand, vec3 target);
enum result plan_approach(struct plan *plan, struct hand *hand,
                          vec3 target); // straight where that is clear, otherwise as plan_reach
enum result plan_withdraw(struct plan *plan, struct hand *hand);

// Instruments let go of what they touch, and retreat from where bones come.
enum result plan_joint(struct plan *plan, const struct joint_hold *to);
