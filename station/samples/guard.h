// Catches poses that a body cannot have taken: a tracker's frame that says it is valid and lies
// metres away, an encoder's angle that leaps.
//
// A pose is taken where a hand can have brought the body since the poses that were taken: no
// farther from the newest than its greatest speed allows, and no farther from where the last ones
// point than its greatest acceleration allows. So a jump is judged by its time, at 10 poses a
// second as at 300. jump_mm and jump_rad are added for noise and coarse steps, and what is within
// them of the newest pose is always taken.
//
// A source may say a pose again until it has measured the next one. The time of a step is then that
// since the pose changed, but not longer than the shortest of the last steps took: a body at rest
// does not save up motion. (Until it has made a few steps, each saying counts.)
//
// Other poses are caught, until they have lain together for GUARD_CONFIRMATION_NS and
// GUARD_CONFIRMATIONS of them: then the body was truly moved. The first pose, the first one after
// guard_forget, and the first one after GUARD_MEMORY_NS without any, is always taken.
#pragma once

#include "base/history.h"

#include <stdbool.h>
#include <stdint.h>

#define GUARD_CONFIRMATIONS 5
#define GUARD_CONFIRMATION_NS 1200000000LL
#define GUARD_MEMORY_NS 1000000000LL
#define GUARD_STEP_NS 250000000LL // a step that takes longer tells nothing of the source's rate
#define GUARD_STEPS 8

// What moves the body, at most.
struct guard_mover {
    double mm_s, mm_s2, rad_s, rad_s2;
};

extern const struct guard_mover guard_hand, guard_joint;

// Poses in a row that a body can have taken, each once, with the time at which it was first said.
struct guard_track {
    struct history poses;
    int64_t said_ns;               // when the newest one was last said
    int64_t steps_ns[GUARD_STEPS]; // between the last ones; 0: not known
    int next_step;
};

struct guard {
    double jump_mm, jump_rad;
    const struct guard_mover *mover;
    struct guard_track taken, caught; // caught: in a row, lying together
    int caught_count;
    int64_t caught_since_ns; // the first of them
    int64_t seen_ns;         // the newest pose, taken or caught
};

void guard_init(struct guard *guard, const struct guard_mover *mover, double jump_mm,
                double jump_deg);
void guard_forget(struct guard *guard); // the body was lost: the next pose is taken

// Were poses being caught until just now?
bool guard_is_catching(const struct guard *guard, int64_t now_ns);

// False: caught, do not use it. Times must rise; one that does not is caught.
bool guard_takes(struct guard *guard, int64_t time_ns, pose p);
