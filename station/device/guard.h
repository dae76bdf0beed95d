// Catches poses that a body cannot have taken: a tracker's frame that says it is valid and lies
// metres away.
//
// A pose is taken if it lies within jump_mm of the newest one taken, or of where the last two
// predict it (a fast hand at a slow rate). Others are caught, until GUARD_CONFIRMATIONS of them in
// a row lie together: then the body was truly moved. The first pose, and the first one after
// guard_forget, is always taken.
#pragma once

#include "base/history.h"

#include <stdbool.h>
#include <stdint.h>

#define GUARD_CONFIRMATIONS 5
#define GUARD_PREDICTION_NS 250000000LL // a prediction is worth nothing later than that

struct guard {
    double jump_mm;
    struct history taken;
    struct history caught; // in a row, lying together
};

void guard_init(struct guard *guard, double jump_mm);
void guard_forget(struct guard *guard); // the body was lost: the next pose is taken

// False: caught, do not use it. Times must rise; one that does not is caught.
bool guard_takes(struct guard *guard, int64_t time_ns, pose p);
