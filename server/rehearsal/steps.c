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

vec3 place_of(const struct knee_case *knee, vec3 at) {
    return (vec3){knee->joint.side == SIDE_LEFT ? -at.x : at.x, at.y, at.z};
}

static double clamped(double value, double most) {
    return fmin(fmax(value, -most), most);
}

static struct joint_hold hold_of(const struct planner *p, const struct goal *goal,
                                 const struct stance *stance) {
    struct joint_hold hold = p->plan.hold;
    double flexion = stance->flexion_deg, valgus = stance->valgus_deg, more = 1.2;
    if (!isnan(goal->flexion_from_deg))
        flexion = 0.5 * (goal->flexion_from_deg + goal->flexion_to_deg);
    if (!isnan(goal->valgus_deg))
        valgus = more * goal->valgus_deg;
    if (!isnan(goal->varus_deg))
        valgus = -more * goal->varus_deg;
    hold.flexion_deg = fmax(clamped(flexion, 140), 0);
    hold.valgus_deg = clamped(valgus, 15);
    if (!isnan(goal->drawer_mm))
        hold.drawer_mm = clamped(more * goal->drawer_mm, 10);
    return hold;
}

void take_out_tools(struct planner *p) {
    for (int i = 0; i < p->plan.motion->tool_count; i++) {
        const struct hand *hand = &p->plan.hands[i];
        if (hand->channel != CHANNEL_SCOPE && hand->inside)
            add_named(p->script, MOTION_WITHDRAW, hand->channel, "");
    }
}

void hold_joint(struct planner *p, const struct goal *goal, const struct stance *stance) {
    struct joint_hold now = p->plan.hold, hold = hold_of(p, goal, stance);
    if (hold.flexion_deg != now.flexion_deg)
        add_amount(p->script, MOTION_FLEX, hold.flexion_deg);
    if (hold.valgus_deg != now.valgus_deg)
        add_amount(p->script, MOTION_VALGUS, hold.valgus_deg);
    if (hold.drawer_mm != now.drawer_mm)
        add_amount(p->script, MOTION_DRAWER, hold.drawer_mm);
}

bool plan_from(struct planner *p, int first) {
    struct plan_mark before = plan_mark(&p->plan);
    for (int i = first; i < p->script->step_count; i++) {
        const struct motion_step *step = &p->script->steps[i];
        enum result result = plan_step(&p->plan, step);
        if (result == RESULT_OK)
            continue;
        fail_in(p->err, result, "step %d (%s): ", i + 1, motion_verb_name(step->verb));
        plan_back(&p->plan, &before);
        p->script->step_count = first;
        return false;
    }
    return true;
}
