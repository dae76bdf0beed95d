#include "motion/dice.h"
#include "rehearsal/planner.h"

#define DETOURS 2 // before each look

struct novice {
    const struct knee_case *knee;
    struct motion_script *script;
    uint64_t dice;
};

// Looks somewhere else and waits.
static void stray(struct novice *n) {
    for (int i = 0; i < DETOURS && n->knee->landmark_count; i++) {
        uint64_t which = dice_bits(&n->dice) % (uint64_t)n->knee->landmark_count;
        const struct case_landmark *landmark = &n->knee->landmarks[which];
        add_place(n->script, MOTION_LOOK, CHANNEL_SCOPE, body_name(landmark->body), landmark->name,
                  "");
        add_amount(n->script, MOTION_WAIT, 1 + (double)(dice_bits(&n->dice) % 3));
    }
}

static bool is_look(enum motion_verb verb) {
    return verb == MOTION_LOOK || verb == MOTION_STAND;
}

static bool is_touch(enum motion_verb verb) {
    return verb == MOTION_TOUCH || verb == MOTION_PALPATE;
}

static void add_again(struct novice *n, const struct motion_step *step) {
    struct motion_step *added = add_step(n->script, step->verb);
    if (added)
        *added = *step;
}

// Touches while the scope looks elsewhere, and then looks back.
static void poke(struct novice *n, const struct motion_step *touch,
                 const struct motion_step *looked) {
    stray(n);
    add_again(n, touch);
    if (looked)
        add_again(n, looked);
}

// The expert's steps, slower, with a tremor, a detour before each look and a blind poke before each
// touch.
void become_novice(const struct motion_script *expert, const struct knee_case *knee, int64_t seed,
                   struct motion_script *out) {
    struct novice n = {knee, out, (uint64_t)seed};
    const struct motion_step *looked = NULL;
    *out = *expert;
    out->seed = seed & UINT32_MAX;
    out->speed_mm_s = out->joint_speed_deg_s = 12;
    out->tremor_mm = 0.8;
    out->skips = true;
    out->step_count = 0;
    for (int i = 0; i < expert->step_count; i++) {
        const struct motion_step *step = &expert->steps[i];
        if (is_look(step->verb)) {
            stray(&n);
            looked = step;
        } else if (is_touch(step->verb)) {
            poke(&n, step, looked);
        }
        add_again(&n, step);
    }
}
