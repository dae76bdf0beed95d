// A jaw takes a loose body out. For plan.c only.
#pragma once

#include "motion/move.h"

// The hand is inside. It goes to the step's place, if that is free, or else to the middle of the
// loose body where it lies at first, with the bones as the patient has them; closes; withdraws, and
// opens outside. RESULT_MISSING: the case has
// no such loose body; RESULT_INVALID: the shaft does not reach it.
enum result take(struct plan *plan, struct hand *hand, const struct motion_step *step);
