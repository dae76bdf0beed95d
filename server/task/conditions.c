#include "task/conditions.h"

#include <math.h>

#define TOUCH_MM 1.0   // a tip this near touches; a tracker's noise is well below
#define INSIDE_MM 15.0 // a tip this near to a surface is in the knee
#define CLEARLY 1e-9   // a difference of cosines that no rounding makes
#define CLEARLY_MM 1e-6
#define LEVEL_MIN 0.2 // looked at along its axis, the tibia stands upright in any picture

// An error that was counted goes on until it misses its bound by more than noise does.
#define SPARE_MM 0.3         // at most half of a bound
#define SPARE_SPEED 0.2      // of the bound
#define SPARE_SHARE 0.02     // of the plan
#define SPARE_PICTURE_MM 0.5 // the tip is so far in the picture: its noise and the scope's
#define SPARE_PLACE_MM 0.5   // from where it was nearest to one of its groups

// ---- looking ------------------------------------------------------------------------------------

struct looking looking_at(const struct site *site, const struct session_output *output) {
    const struct instruments *tools = site_tools(site);
    struct looking looking = {.T_mockup_scope = {.rotation = quat_identity()}};
    for (int i = 0; i < tools->count && !looking.is_there; i++) {
        const struct instrument_output *o = &output->instruments[i];
        if (tools->of[i].kind == INSTRUMENT_OPTIC && o->present)
            looking = (struct looking){true, i, o->T_mockup_warped,
                                       optic_axis(site_optic(site), o->T_mockup_warped),
                                       0.5 * site_optic(site)->field_deg};
    }
    return looking;
}

static double angle_deg(vec3 a, vec3 b) {
    return DEG_PER_RAD * atan2(vec3_length(vec3_cross(a, b)), vec3_dot(a, b));
}

static bool is_in_picture(const struct looking *looking, vec3 p, double share) {
    vec3 way = vec3_sub(p, looking->T_mockup_scope.translation);
    return looking->is_there && angle_deg(looking->axis, way) <= share * looking->half_field_deg;
}

static vec3 across(vec3 v, vec3 axis) {
    return vec3_add_scaled(v, -vec3_dot(v, axis), axis);
}

static bool is_upright(const struct goal *goal, const struct site *site,
                       const struct session_output *output, const struct looking *looking) {
    if (isnan(goal->upright_deg))
        return true;
    const struct joint_frame *joint = &site_case(site)->joint;
    pose T = pose_compose(output->T_mockup_virtual[BODY_TIBIA], joint->T_tibia_joint);
    vec3 proximal = across(quat_rotate(T.rotation, (vec3){0, 0, 1}), looking->axis);
    vec3 up = across(quat_rotate(looking->T_mockup_scope.rotation, (vec3){0, 1, 0}), looking->axis);
    return vec3_length(proximal) < LEVEL_MIN || angle_deg(up, proximal) <= goal->upright_deg;
}

// Most points are clearly beside or clearly within, and their cosine says so cheaply.
static bool is_in_centre(const struct goal *goal, const struct looking *looking, double seen_cosine,
                         vec3 p, double distance) {
    vec3 way = vec3_sub(p, looking->T_mockup_scope.translation);
    double beyond = vec3_dot(looking->axis, way) - seen_cosine * distance;
    if (fabs(beyond) > CLEARLY * distance)
        return beyond > 0;
    return is_in_picture(looking, p, goal->centre);
}

static bool is_point_seen(const struct goal *goal, const struct site *site, int index,
                          const struct session_output *output, const struct looking *looking,
                          uint32_t cut, vec3 p, struct sight_hint *hint) {
    vec3 scope = looking->T_mockup_scope.translation;
    double distance = vec3_distance(p, scope);
    return distance <= goal->within_mm && distance >= goal->beyond_mm &&
           is_in_centre(goal, looking, site_goal(site, index)->seen_cosine, p, distance) &&
           site_sees(site, output->T_mockup_virtual, scope, cut, p, hint);
}

bool goal_may_be_seen(const struct goal *goal, const struct site *site, int index,
                      const struct session_output *output, const struct looking *looking) {
    const struct site_goal *g = site_goal(site, index);
    if (!goal->see[0] || !looking->is_there)
        return !goal->see[0];
    vec3 middle = pose_apply(output->T_mockup_virtual[g->see.body], g->see.middle);
    vec3 way = vec3_sub(middle, looking->T_mockup_scope.translation);
    double distance = vec3_length(way), radius = g->see.radius_mm + CLEARLY_MM;
    return distance - radius <= goal->within_mm && distance + radius >= goal->beyond_mm &&
           vec3_dot(looking->axis, way) + radius >= g->seen_cosine * (distance - radius);
}

// The point that was seen last is tried first.
bool goal_is_seen(const struct goal *goal, const struct site *site, int index,
                  const struct session_output *output, const struct looking *looking,
                  struct attempt *attempt) {
    const struct spot *spot = &site_goal(site, index)->see;
    struct goal_hints *hints = &attempt->hints[index];
    if (!goal->see[0])
        return true;
    if (!is_upright(goal, site, output, looking))
        return false;
    const pose *T = &output->T_mockup_virtual[spot->body];
    for (int k = 0; k < spot->shown_count; k++) {
        int i = (hints->shown + k) % spot->shown_count;
        if (!is_point_seen(goal, site, index, output, looking, attempt->cut,
                           pose_apply(*T, spot->shown[i]), &hints->hidden_by[i]))
            continue;
        hints->shown = i;
        return true;
    }
    return false;
}

// ---- portals ------------------------------------------------------------------------------------

static double shaft_off(const struct site *site, int portal, const struct session_output *output,
                        pose T_mockup_tip) {
    vec3 p =
        pose_apply(output->T_mockup_body[BODY_FEMUR], site_case(site)->portals[portal].position);
    vec3 way = vec3_sub(p, T_mockup_tip.translation);
    return vec3_length(across(way, quat_rotate(T_mockup_tip.rotation, (vec3){0, 0, 1})));
}

static bool is_through(const struct site *site, int portal, const struct session_output *output,
                       int tool) {
    const struct instrument_output *o = &output->instruments[tool];
    int nearest = 0;
    if (portal < 0)
        return true;
    for (int i = 1; i < site_case(site)->portal_count; i++)
        if (shaft_off(site, i, output, o->T_mockup_tip) <
            shaft_off(site, nearest, output, o->T_mockup_tip))
            nearest = i;
    return o->present && nearest == portal;
}

bool goal_is_through(const struct site *site, int index, const struct session_output *output,
                     const struct looking *looking) {
    const struct site_goal *g = site_goal(site, index);
    return is_through(site, g->scope_portal, output, looking->tool) &&
           is_through(site, g->tool_portal, output, g->tool);
}

// ---- touching -----------------------------------------------------------------------------------

static bool is_at(const struct instrument_output *o, int group) {
    return o->present && o->warp.nearest == group && o->warp.nearest_mm <= TOUCH_MM;
}

static vec3 tip_on(const struct instrument_output *o, const struct session_output *output,
                   enum body body) {
    return pose_apply(pose_inverse(output->T_mockup_body[body]), o->T_mockup_tip.translation);
}

bool goal_touches(const struct goal *goal, const struct site *site, int index,
                  const struct session_output *output, const struct looking *looking) {
    const struct site_goal *g = site_goal(site, index);
    const struct instrument_output *o = &output->instruments[g->tool];
    if (!goal->touch[0] && !goal->place_count)
        return true;
    if (!is_at(o, g->touch.group) ||
        (goal->in_view && !is_in_picture(looking, o->T_mockup_warped.translation, 1)))
        return false;
    return goal->place_count || vec3_distance(tip_on(o, output, g->touch.body), g->touch.at) <=
                                    g->touch.depth_mm + goal->reach_mm;
}

int32_t goal_goes_along(const struct goal *goal, const struct site_goal *g,
                        const struct session_output *output, int32_t along) {
    vec3 tip = tip_on(&output->instruments[g->tool], output, g->touch.body);
    while (along < g->line_count && vec3_distance(tip, g->line[along]) <= goal->reach_mm)
        along++;
    return along;
}

// ---- the joint and the resection ----------------------------------------------------------------

static bool at_least(double value, double least) {
    return isnan(least) || value >= least;
}

static bool at_most(double value, double most) {
    return isnan(most) || value <= most;
}

// Of the joint that is shown: the patient's gives way where a ligament is torn. Beside the flexion
// it counts from the joint at rest.
bool goal_holds_joint(const struct goal *goal, const struct site *site,
                      const struct session_output *output) {
    if (isnan(goal->valgus_deg) && isnan(goal->varus_deg) && isnan(goal->drawer_mm) &&
        isnan(goal->flexion_from_deg))
        return true;
    const pose *T = output->T_mockup_virtual;
    struct joint_angles now = joint_from_pose(
        &site_case(site)->joint, pose_compose(pose_inverse(T[BODY_FEMUR]), T[BODY_TIBIA]));
    struct joint_angles rest = case_rest(site_case(site), now.flexion_deg);
    double varus_deg = now.varus_deg - rest.varus_deg;
    return at_least(-varus_deg, goal->valgus_deg) && at_least(varus_deg, goal->varus_deg) &&
           at_least(now.drawer_mm - rest.drawer_mm, goal->drawer_mm) &&
           at_least(now.flexion_deg, goal->flexion_from_deg) &&
           at_most(now.flexion_deg, goal->flexion_to_deg);
}

bool goal_resected(const struct goal *goal, const struct site_goal *g,
                   const struct attempt *attempt) {
    const struct quality_report *r = &attempt->resections[g->tissue];
    if (!goal->resect[0])
        return true;
    return (attempt->cut >> g->tissue & 1) &&
           at_most(r->under_mm3, goal->under_share * r->planned_mm3) &&
           at_most(r->over_mm3, goal->over_share * r->planned_mm3) &&
           at_least(r->rim_mm, goal->rim_mm) && at_most(r->step_mm, goal->step_mm);
}

bool goal_took_out(const struct goal *goal, const struct site_goal *g,
                   const struct session_output *output) {
    for (int i = 0; goal->take_out[0] && i < output->loose_count; i++)
        if ((g->loose >> i & 1) && output->loose[i].state != LOOSE_OUT)
            return false;
    return true;
}

// ---- errors -------------------------------------------------------------------------------------

static double spare_of(double bound, const struct error_state *state) {
    return state->counted ? fmin(SPARE_MM, 0.5 * bound) : 0;
}

static bool is_of_group(const struct site *site, int error, const struct instrument_output *o,
                        struct error_state *state) {
    vec3 tip = o->T_mockup_tip.translation;
    if (o->warp.nearest < 0)
        return false;
    if (!site_error_has_group(site, error, o->warp.nearest))
        return state->counted && vec3_distance(tip, state->at) <= SPARE_PLACE_MM;
    state->at = tip;
    return true;
}

static bool is_near(double near_mm, const struct instrument_output *o,
                    const struct error_state *state) {
    return isnan(near_mm) || o->warp.nearest_mm <= near_mm + spare_of(near_mm, state);
}

static bool is_deep(double deep_mm, const struct instrument_output *o,
                    const struct error_state *state) {
    return isnan(deep_mm) || o->penetration_mm >= deep_mm - spare_of(deep_mm, state);
}

static bool is_fast(double speed_mm_s, double speed, const struct error_state *state) {
    return isnan(speed_mm_s) || speed > speed_mm_s * (state->counted ? 1 - SPARE_SPEED : 1);
}

static bool turns(const struct site *site, int tool, const struct instrument_output *o) {
    const struct instrument *instrument = &site_tools(site)->of[tool];
    return instrument->kind == INSTRUMENT_BURR && instrument->button >= 0 &&
           o->handle_validity != VALIDITY_LOST && (o->handle.buttons >> instrument->button & 1);
}

static bool is_unseen(const struct instrument_output *o, const struct looking *looking,
                      const struct error_state *state) {
    vec3 tip = o->T_mockup_warped.translation;
    double away_mm = vec3_distance(tip, looking->T_mockup_scope.translation);
    double spare_deg = state->counted ? DEG_PER_RAD * atan2(SPARE_PICTURE_MM, away_mm) : 0;
    return looking->is_there && o->warp.nearest >= 0 && is_near(INSIDE_MM, o, state) &&
           !is_in_picture(looking, tip, 1 - spare_deg / looking->half_field_deg);
}

static bool is_cut_beyond(const struct task_error *error, const struct attempt *attempt,
                          const struct error_state *state) {
    double share = fmax(0, error->over_share - (state->counted ? SPARE_SHARE : 0));
    for (int i = 0; i < TISSUES_MAX; i++) {
        const struct quality_report *r = &attempt->resections[i];
        if (r->over_mm3 > share * r->planned_mm3)
            return true;
    }
    return false;
}

bool error_is_of_tool(const struct site *site, int error) {
    const struct task_error *e = &site_task(site)->errors[error];
    return isnan(e->over_share) && !e->dropped;
}

bool error_holds(const struct site *site, int error, int tool, const struct session_output *output,
                 const struct looking *looking, const struct attempt *attempt,
                 struct error_state *state) {
    const struct task_error *e = &site_task(site)->errors[error];
    const struct instrument_output *o = &output->instruments[tool];
    if (e->dropped)
        return output->events & EVENT_DROPPED;
    if (!error_is_of_tool(site, error))
        return is_cut_beyond(e, attempt, state);
    if (!o->present || !site_error_concerns(site, error, tool))
        return false;
    bool is_free = isnan(e->deep_mm) && isnan(e->near_mm); // of groups
    return (is_free || is_of_group(site, error, o, state)) && is_deep(e->deep_mm, o, state) &&
           is_near(e->near_mm, o, state) && is_fast(e->speed_mm_s, attempt->speeds[tool], state) &&
           (!e->running || turns(site, tool, o)) && (!e->unseen || is_unseen(o, looking, state));
}
