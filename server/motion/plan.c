#include "base/check.h"
#include "motion/look.h"
#include "motion/motion.h"
#include "motion/move.h"
#include "motion/path.h"
#include "motion/place.h"
#include "motion/resect.h"
#include "motion/take.h"
#include "motion/way.h"

#include <stdlib.h>
#include <string.h>

struct hand *plan_hand(struct plan *plan, enum channel tool) {
    for (int i = 0; i < plan->motion->tool_count; i++)
        if (plan->motion->tools[i].channel == tool)
            return &plan->hands[i];
    return NULL;
}

static enum result approach(struct plan *plan, struct hand *hand) {
    return plan_withdraw(plan, hand) == RESULT_OK ? plan_enter(plan, hand) : RESULT_INVALID;
}

static enum result move_joint(struct plan *plan, const struct motion_step *step) {
    struct joint_hold to = plan->hold;
    if (step->verb == MOTION_FLEX)
        to.flexion_deg = step->amount;
    else if (step->verb == MOTION_VALGUS)
        to.valgus_deg = step->amount;
    else
        to.drawer_mm = step->amount;
    return plan_joint(plan, &to);
}

static enum result find_group(const struct plan *plan, const char *name,
                              struct case_group **out_group) {
    *out_group = case_group(plan->knee, name);
    if (*out_group)
        return RESULT_OK;
    return fail(plan->err, RESULT_MISSING, "the case has no group %s", name);
}

// ---- palpate ------------------------------------------------------------------------------------

static enum result unreached(const struct plan *plan, const struct hand *hand,
                             const struct motion_place *place, vec3 tip) {
    char name[PLACE_NAME_MAX];
    return fail_in(plan->err, plan_refuse(plan, hand, tip),
                   "%s cannot be reached: ", place_name(place, name));
}

static const double least_touch = 2; // mm of a line that is worth a touch

static bool has_landmark(const struct motion_step *step) {
    return step->from.landmark[0] || step->to.landmark[0];
}

// Points are of one knee, and their line must be reached as it is. Landmarks are of any knee: of
// their line the hand goes as far as it comes.
static enum result shorten(const struct plan *plan, const struct hand *hand,
                           const struct motion_step *step, pose T, struct tip_path *line) {
    char name[2][PLACE_NAME_MAX];
    vec3 first = line->points[0];
    if (!has_landmark(step))
        return tip_path_has_jump(line, plan->err) ? RESULT_INVALID : RESULT_OK;
    tip_path_keep_reached(line, plan, hand, T);
    if (line->count >= 2 && line->ways[line->count - 1] >= least_touch)
        return RESULT_OK;
    place_name(&step->from, name[0]);
    place_name(&step->to, name[1]);
    if (!plan_is_clear(plan, hand, pose_apply(T, first)))
        return unreached(plan, hand, &step->from, pose_apply(T, first));
    return fail(plan->err, RESULT_INVALID,
                "less than %g mm of the line from %s to %s can be reached through the portal %s",
                least_touch, name[0], name[1], hand->portal.name);
}

static enum result touch(struct plan *plan, struct hand *hand, const struct motion_step *step,
                         const struct case_group *group, const struct query *surface) {
    pose T = plan_body_pose(plan, group->body);
    vec3 from, to;
    struct tip_path line = {0};
    if (place_find(plan->knee, &step->from, &from, plan->err) != RESULT_OK ||
        place_find(plan->knee, &step->to, &to, plan->err) != RESULT_OK)
        return RESULT_MISSING;
    tip_path_between(&line, surface, from, to);
    enum result result = shorten(plan, hand, step, T, &line);
    if (result == RESULT_OK)
        result = plan_reach(plan, hand, pose_apply(T, line.points[0]));
    if (result == RESULT_OK)
        result = tip_path_slide(plan, hand, group, surface, &line);
    tip_path_fini(&line);
    return result;
}

static enum result palpate(struct plan *plan, struct hand *hand, const struct motion_step *step) {
    struct case_group *group;
    struct mesh outer;
    struct query *surface;
    if (find_group(plan, step->name, &group) != RESULT_OK)
        return RESULT_MISSING;
    case_group_surface(group, &outer);
    enum result result = query_create(&outer, &surface, plan->err);
    if (result == RESULT_OK)
        result = touch(plan, hand, step, group, surface);
    query_destroy(&surface);
    mesh_fini(&outer);
    return result;
}

// ---- bite ---------------------------------------------------------------------------------------

// The vertex nearest to a point that the shaft reaches past all bones.
static enum result reachable_point(struct plan *plan, const struct hand *hand,
                                   const struct case_group *group, vec3 near, vec3 *out_point) {
    const struct mesh *mesh = &group->mesh;
    pose T = plan_body_pose(plan, group->body);
    double least = INFINITY;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 p = mesh_vertex(mesh, v);
        double distance = vec3_distance(p, near);
        if (distance < least && plan_is_clear(plan, hand, pose_apply(T, p))) {
            least = distance;
            *out_point = p;
        }
    }
    if (isfinite(least))
        return RESULT_OK;
    return fail(plan->err, RESULT_INVALID, "no point of %s can be reached from the portal %s",
                group->name, hand->portal.name);
}

static enum result reachable_middle(struct plan *plan, const struct hand *hand,
                                    const struct case_group *group, vec3 *out_point) {
    struct box box = mesh_bounds(&group->mesh);
    return reachable_point(plan, hand, group, vec3_lerp(box.min, box.max, 0.5), out_point);
}

static enum result bite_point(struct plan *plan, const struct hand *hand,
                              const struct case_group *group, const struct motion_step *step,
                              vec3 *out_point) {
    if (!step->has_place)
        return reachable_middle(plan, hand, group, out_point);
    struct query *surface = NULL;
    enum result result = place_find(plan->knee, &step->from, out_point, plan->err);
    if (result == RESULT_OK)
        result = query_create(&group->mesh, &surface, plan->err);
    if (result == RESULT_OK)
        *out_point = tip_path_on_surface(surface, *out_point);
    query_destroy(&surface);
    return result;
}

static enum result bite_free(struct plan *plan, struct hand *hand, const struct motion_step *step,
                             const struct case_group *group) {
    vec3 tip = pose_apply(plan_body_pose(plan, group->body), step->from.at);
    if (!plan_bites_at(plan, hand, tip))
        return unreached(plan, hand, &step->from, tip);
    if (plan_roll(plan, hand, RAD_PER_DEG * step->roll_deg) != RESULT_OK ||
        plan_approach(plan, hand, plan_before_bite(hand, tip)) != RESULT_OK)
        return RESULT_INVALID;
    return plan_bite(plan, hand, tip);
}

static enum result bite(struct plan *plan, struct hand *hand, const struct motion_step *step) {
    struct case_group *group;
    if (find_group(plan, step->name, &group) != RESULT_OK)
        return RESULT_MISSING;
    if (step->is_free)
        return bite_free(plan, hand, step, group);
    vec3 point = {0};
    enum result result = bite_point(plan, hand, group, step, &point);
    if (result != RESULT_OK)
        return result;
    vec3 target = pose_apply(plan_body_pose(plan, group->body), point);
    if (!plan_is_clear(plan, hand, target))
        return unreached(plan, hand, &step->from, target);
    if (plan_reach(plan, hand, plan_before_bite(hand, target)) != RESULT_OK)
        return RESULT_INVALID;
    return plan_bite(plan, hand, target);
}

// ---- resect and trace ---------------------------------------------------------------------------

static enum result resect(struct plan *plan, struct hand *hand, const struct motion_step *step) {
    struct case_group *group;
    if (find_group(plan, step->name, &group) != RESULT_OK)
        return RESULT_MISSING;
    struct resection resection;
    enum result result = resection_init(&resection, plan->knee, group, plan->err);
    if (result == RESULT_OK && step->verb == MOTION_RESECT)
        result = resection_bite(&resection, plan, hand, step->count);
    else if (result == RESULT_OK)
        result = resection_trace(&resection, plan, hand);
    resection_fini(&resection);
    return result;
}

// ---- touch and wait -----------------------------------------------------------------------------

static enum result rest(struct plan *plan, double seconds, const struct case_group *touch) {
    int rows = (int)ceil(seconds * plan->script->rate_hz);
    for (int i = 0; i < rows; i++)
        if (plan_add_row(plan, touch) != RESULT_OK)
            return RESULT_INVALID;
    return RESULT_OK;
}

static enum result touch_place(struct plan *plan, struct hand *hand,
                               const struct motion_step *step) {
    struct case_group *group;
    vec3 point = {0};
    if (find_group(plan, step->name, &group) != RESULT_OK ||
        bite_point(plan, hand, group, step, &point) != RESULT_OK)
        return RESULT_MISSING;
    pose T = plan_body_pose(plan, group->body);
    if (!plan_is_clear(plan, hand, pose_apply(T, point)) &&
        reachable_point(plan, hand, group, point, &point) != RESULT_OK)
        return RESULT_INVALID;
    if (plan_reach(plan, hand, pose_apply(T, point)) != RESULT_OK)
        return RESULT_INVALID;
    return rest(plan, step->amount, group);
}

// ---- look ---------------------------------------------------------------------------------------

static enum result look(struct plan *plan, struct hand *hand, const struct motion_step *step) {
    struct case_group *group;
    if (find_group(plan, step->name, &group) != RESULT_OK)
        return RESULT_MISSING;
    if (step->verb == MOTION_STAND)
        return look_stand(plan, hand, step, group);
    if (step->verb == MOTION_TURN)
        return look_turn(plan, hand, step, group);
    return look_to(plan, hand, step, group);
}

// ---- the whole script ---------------------------------------------------------------------------

static enum result do_step(struct plan *plan, const struct motion_step *step) {
    if (step->verb == MOTION_FLEX || step->verb == MOTION_VALGUS || step->verb == MOTION_DRAWER)
        return move_joint(plan, step);
    if (step->verb == MOTION_WAIT)
        return rest(plan, step->amount, NULL);
    struct hand *hand = plan_hand(plan, step->tool);
    if (hand && step->verb == MOTION_APPROACH)
        return approach(plan, hand);
    if (!hand || !hand->inside)
        return fail(plan->err, RESULT_INVALID, "%s is not inside: approach first",
                    channel_name(step->tool));
    if (step->verb == MOTION_PALPATE)
        return palpate(plan, hand, step);
    if (step->verb == MOTION_BITE)
        return bite(plan, hand, step);
    if (step->verb == MOTION_TOUCH)
        return touch_place(plan, hand, step);
    if (step->verb == MOTION_TAKE)
        return take(plan, hand, step);
    if (step->verb == MOTION_LOOK || step->verb == MOTION_STAND || step->verb == MOTION_TURN)
        return look(plan, hand, step);
    if (step->verb == MOTION_RESECT || step->verb == MOTION_TRACE)
        return resect(plan, hand, step);
    return plan_withdraw(plan, hand);
}

void plan_back(struct plan *plan, const struct plan_mark *mark) {
    memcpy(plan->hands, mark->hands, sizeof plan->hands);
    plan->joint = mark->joint;
    plan->hold = mark->hold;
    plan->motion->row_count = mark->row_count;
}

struct plan_mark plan_mark(const struct plan *plan) {
    struct plan_mark mark = {
        .joint = plan->joint, .hold = plan->hold, .row_count = plan->motion->row_count};
    memcpy(mark.hands, plan->hands, sizeof mark.hands);
    return mark;
}

enum result plan_step(struct plan *plan, const struct motion_step *step) {
    struct plan_mark before = plan_mark(plan);
    enum result result = do_step(plan, step);
    if (result != RESULT_OK)
        plan_back(plan, &before);
    return result;
}

static const struct case_portal *find_portal(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->portal_count; i++)
        if (strcmp(knee->portals[i].name, name) == 0)
            return &knee->portals[i];
    return NULL;
}

enum result plan_take_up(struct plan *plan, enum channel tool, const char *name) {
    const struct case_portal *portal = find_portal(plan->knee, name);
    if (!portal)
        return fail(plan->err, RESULT_MISSING, "the case has no portal %s", name);
    const struct hand *known = plan_hand(plan, tool);
    if (known && strcmp(known->portal.name, name) != 0)
        return fail(plan->err, RESULT_INVALID, "%s goes through the portal %s already",
                    channel_name(tool), known->portal.name);
    if (known)
        return RESULT_OK;
    int i = plan->motion->tool_count++;
    plan->motion->tools[i] = (struct motion_tool){tool, portal->position};
    struct hand *hand = &plan->hands[i];
    *hand = (struct hand){.channel = tool, .portal = *portal, .tip = hand_rest(portal)};
    hand->rotation = quat_identity();
    tremor_init(&hand->tremor, plan->script->tremor_mm,
                (uint64_t)plan->script->seed * INSTRUMENT_COUNT + (uint64_t)i);
    return RESULT_OK;
}

enum result plan_begin(struct plan *plan) {
    for (enum body body = 0; body < BODY_COUNT; body++) {
        const struct case_group *bone = case_group(plan->knee, body_name(body));
        enum result result =
            bone ? solid_init(&plan->bones[body], &bone->mesh, plan->err) : RESULT_OK;
        if (result != RESULT_OK)
            return result;
    }
    if (!plan->bones[BODY_FEMUR].mesh || !plan->bones[BODY_TIBIA].mesh)
        return fail(plan->err, RESULT_MISSING, "the case has no femur or no tibia");
    enum result result = place_prepare(plan->knee, plan->script, plan->err);
    bool plays_without = plan->script->skips && plan->knee->portal_count > 0;
    return plays_without ? RESULT_OK : result;
}

static enum result at_step(const struct plan *plan, int step, enum result result) {
    if (result == RESULT_OK)
        return result;
    return fail_in(plan->err, result, "step %d (%s): ", step + 1,
                   motion_verb_name(plan->script->steps[step].verb));
}

static void leave_out(struct plan *plan) {
    struct motion *motion = plan->motion;
    if (!motion->skipped)
        motion->skipped = alloc((size_t)plan->script->step_count, sizeof *motion->skipped);
    motion->skipped[motion->skipped_count++] = *plan->err;
}

static bool is_work(enum motion_verb verb) {
    return verb == MOTION_PALPATE || verb == MOTION_BITE || verb == MOTION_RESECT ||
           verb == MOTION_TRACE || verb == MOTION_LOOK || verb == MOTION_STAND ||
           verb == MOTION_TURN || verb == MOTION_TOUCH;
}

static enum result do_steps(struct plan *plan) {
    const struct motion_script *script = plan->script;
    bool works = false;
    for (int i = 0; i < script->step_count; i++) {
        enum result result = at_step(plan, i, plan_step(plan, &script->steps[i]));
        if (result != RESULT_OK && !script->skips)
            return result;
        if (result != RESULT_OK)
            leave_out(plan);
        works |= result == RESULT_OK && is_work(script->steps[i].verb);
    }
    return works || plan->motion->skipped_count == 0 ? RESULT_OK : RESULT_INVALID;
}

static enum result play(struct plan *plan) {
    const struct motion_script *script = plan->script;
    enum result result = plan_begin(plan);
    for (int i = 0; i < script->step_count && result == RESULT_OK; i++)
        if (script->steps[i].verb == MOTION_APPROACH)
            result =
                at_step(plan, i, plan_take_up(plan, script->steps[i].tool, script->steps[i].name));
    if (result == RESULT_OK)
        result = plan_add_row(plan, NULL);
    return result == RESULT_OK ? do_steps(plan) : result;
}

void plan_end(struct plan *plan) {
    for (enum body body = 0; body < BODY_COUNT; body++)
        if (plan->bones[body].mesh)
            solid_fini(&plan->bones[body]);
}

enum result motion_plan(struct knee_case *knee, const struct motion_script *script,
                        struct motion *out_motion, struct error *err) {
    *out_motion = (struct motion){0};
    struct error why;
    struct plan plan = {
        .knee = knee, .script = script, .motion = out_motion, .err = err ? err : &why};
    enum result result = play(&plan);
    plan_end(&plan);
    if (result != RESULT_OK)
        motion_fini(out_motion);
    return result;
}

void motion_fini(struct motion *motion) {
    free(motion->rows);
    free(motion->skipped);
    *motion = (struct motion){0};
}
