#include "rehearsal/take.h"

#include "rehearsal/forecast.h"

static void look_at_loose(struct motion_script *script, const struct knee_case *knee,
                          const struct case_loose *loose, double distance) {
    struct motion_step *step =
        add_named(script, MOTION_LOOK, CHANNEL_SCOPE, body_name(loose->body));
    if (!step)
        return;
    step->has_place = true;
    step->amount = distance;
    step->from.at = place_of(knee, loose->at);
}

// The hand aims at where the scope shows it.
static vec3 aim_at(struct planner *p, int index) {
    enum body body = p->knee->loose[index].body;
    const struct hand *hand = plan_hand(&p->plan, CHANNEL_FIRST_DESCRIBED);
    const struct case_group *bone = case_group(p->knee, body_name(body));
    struct forecast *f = forecast_create(p->scene, (int)(bone - p->knee->groups));
    forecast_take(f, play_operation(p->play), &p->plan.joint);
    vec3 tip = forecast_aim(f, &p->plan, hand, hand->roll, play_loose(p->play, index));
    forecast_destroy(&f);
    return pose_apply_inverse(plan_body_pose(&p->plan, body), tip);
}

static bool take_one(struct planner *p, int index, double distance) {
    const struct case_loose *loose = &p->knee->loose[index];
    int first = p->script->step_count;
    look_at_loose(p->script, p->knee, loose, distance);
    add_named(p->script, MOTION_APPROACH, CHANNEL_FIRST_DESCRIBED, p->portals[1]);
    if (!plan_from(p, first))
        return false;
    play_on(p->play, p->plan.motion);
    first = p->script->step_count;
    struct motion_step *step =
        add_named(p->script, MOTION_TAKE, CHANNEL_FIRST_DESCRIBED, loose->name);
    if (!step)
        return false;
    step->is_free = true;
    step->from.at = aim_at(p, index);
    return plan_from(p, first);
}

bool take_out(struct planner *p, uint32_t which, double distance) {
    for (int i = 0; i < p->knee->loose_count; i++)
        if ((which >> i & 1) && !take_one(p, i, distance))
            return false;
    return true;
}
