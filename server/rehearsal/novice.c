#include "motion/dice.h"
#include "rehearsal/planner.h"

#define DETOURS 2 // before each look

// Looks somewhere else and waits.
static void stray(struct planner *p, uint64_t *dice) {
    for (int i = 0; i < DETOURS && p->knee->landmark_count; i++) {
        uint64_t which = dice_bits(dice) % (uint64_t)p->knee->landmark_count;
        const struct case_landmark *landmark = &p->knee->landmarks[which];
        add_place(p->trial, MOTION_LOOK, CHANNEL_SCOPE, body_name(landmark->body), landmark->name,
                  "");
        add_amount(p->trial, MOTION_WAIT, 1 + (double)(dice_bits(dice) % 3));
    }
}

// The expert's steps, slower, with a tremor and a detour before each look.
void become_novice(struct planner *p, int64_t seed) {
    uint64_t dice = (uint64_t)seed;
    *p->trial = *p->script;
    p->trial->seed = seed & UINT32_MAX;
    p->trial->speed_mm_s = p->trial->joint_speed_deg_s = 12;
    p->trial->tremor_mm = 0.8;
    p->trial->skips = true;
    p->trial->step_count = 0;
    for (int i = 0; i < p->script->step_count; i++) {
        if (p->script->steps[i].verb == MOTION_LOOK)
            stray(p, &dice);
        struct motion_step *step = add_step(p->trial, p->script->steps[i].verb);
        if (step)
            *step = p->script->steps[i];
    }
}
