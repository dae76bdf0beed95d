// Catches poses that a body cannot have taken: a tracker's frame that says it is valid and lies
// metres away, an encoder's angle that leaps.
//
// A pose is taken if it lies within jump_mm and jump_rad of the newest one taken, or of where the
// last two predict it (a fast hand at a slow rate). Others are caught, until they have lain
// together for GUARD_CONFIRMATION_NS and GUARD_CONFIRMATIONS of them: then the body was truly
// moved. The first pose, the first one after guard_forget, and the first one after GUARD_MEMORY_NS
// without any, is always taken.
#pragma once

#include "base/history.h"

#include <stdbool.h>
#include <stdint.h>

#define GUARD_CONFIRMATIONS 5
#define GUARD_CONFIRMATION_NS 1200000000LL
#define GUARD_MEMORY_NS 1000000000LL
#define GUARD_PREDICTION_NS 250000000LL // a prediction is worth nothing later than that

struct guard {
    double jump_mm, jump_rad;
    struct history taken;
    struct history caught;   // in a row, lying together
    int64_t caught_since_ns; // the first of them
    int64_t seen_ns;         // the newest pose, taken or caught
};

void guard_init(struct guard *guard, double jump_mm, double jump_deg);
void guard_forget(struct guard *guard); // the body was lost: the next pose is taken

// Were poses being caught until just now?
bool guard_is_catching(const struct guard *guard, int64_t now_ns);

// False: caught, do not use it. Times must rise; one that does not is caught.
bool guard_takes(struct guard *guard, int64_t time_ns, pose p);
