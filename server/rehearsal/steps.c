#include "rehearsal/planner.h"

#include <math.h>
#include <stdio.h>

struct motion_step *add_step(struct motion_script *script, enum motion_verb verb) {
    if (script->step_count == MOTION_STEPS_MAX)
        return NULL;
    struct motion_step *step = &script->steps[script->step_count++];
    *step = (struct motion_step){.verb = verb};
    return step;
}

void add_amount(struct motion_script *script, enum motion_verb verb, double amount) {
    struct motion_step *step = add_step(script, verb);
    if (step)
        step->amount = amount;
}

struct motion_step *add_named(struct motion_script *script, enum motion_verb verb,
                              enum channel tool, const char *name) {
    struct motion_step *step = add_step(script, verb);
    if (!step)
        return NULL;
    step->tool = tool;
    snprintf(step->name, sizeof step->name, "%s", name);
    return step;
}

struct motion_step *add_place(struct motion_script *script, enum motion_verb verb,
                              enum channel tool, const char *group, const char *from,
                              const char *to) {
    struct motion_step *step = add_named(script, verb, tool, group);
    if (!step)
        return NULL;
    step->has_place = true;
    snprintf(step->from.landmark, sizeof step->from.landmark, "%s", from);
    snprintf(step->to.landmark, sizeof step->to.landmark, "%s", to);
    return step;
}

static double clamped(double value, double most) {
    return fmin(fmax(value, -most), most);
}

void hold_joint(struct motion_script *script, const struct goal *goal,
                const struct stance *stance) {
    double flexion = stance->flexion_deg, valgus = stance->valgus_deg, more = 1.2;
    if (!isnan(goal->flexion_from_deg))
        flexion = 0.5 * (goal->flexion_from_deg + goal->flexion_to_deg);
    if (!isnan(goal->valgus_deg))
        valgus = more * goal->valgus_deg;
    if (!isnan(goal->varus_deg))
        valgus = -more * goal->varus_deg;
    add_amount(script, MOTION_FLEX, fmax(clamped(flexion, 140), 0));
    add_amount(script, MOTION_VALGUS, clamped(valgus, 15));
    if (!isnan(goal->drawer_mm))
        add_amount(script, MOTION_DRAWER, clamped(more * goal->drawer_mm, 10));
}
