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

static bool is_look(enum motion_verb verb) {
    return verb == MOTION_LOOK || verb == MOTION_STAND;
}

static bool is_touch(enum motion_verb verb) {
    return verb == MOTION_TOUCH || verb == MOTION_PALPATE;
}

static void add_again(struct planner *p, const struct motion_step *step) {
    struct motion_step *added = add_step(p->trial, step->verb);
    if (added)
        *added = *step;
}

// Touches while the scope looks elsewhere, and then looks back.
static void poke(struct planner *p, const struct motion_step *touch,
                 const struct motion_step *looked, uint64_t *dice) {
    stray(p, dice);
    add_again(p, touch);
    if (looked)
        add_again(p, looked);
}

// The expert's steps, slower, with a tremor, a detour before each look and a blind poke before each
// touch.
void become_novice(struct planner *p, int64_t seed) {
    uint64_t dice = (uint64_t)seed;
    const struct motion_step *looked = NULL;
    *p->trial = *p->script;
    p->trial->seed = seed & UINT32_MAX;
    p->trial->speed_mm_s = p->trial->joint_speed_deg_s = 12;
    p->trial->tremor_mm = 0.8;
    p->trial->skips = true;
    p->trial->step_count = 0;
    for (int i = 0; i < p->script->step_count; i++) {
        const struct motion_step *step = &p->script->steps[i];
        if (is_look(step->verb)) {
            stray(p, &dice);
            looked = step;
        } else if (is_touch(step->verb)) {
            poke(p, step, looked, &dice);
        }
        add_again(p, step);
    }
}
