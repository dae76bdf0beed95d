#include "motion/way.h"

#include "base/check.h"

#include <stdlib.h>

// How deep inside the portal a tip may be while the shaft turns or the joint moves: the first that
// the bones let. The last is next to the portal, where only a bone round the portal itself is met.
static const double depths[] = {MOTION_SAFE_DEPTH, 10, 6, 3, 1, 0.3};
#define DEPTH_COUNT ((int)(sizeof depths / sizeof *depths))

static const double look_angle = 2 * RAD_PER_DEG; // between directions that are looked at
static const int approach_looks = 20;

static vec3 at_depth(const struct hand *hand, double depth, vec3 direction) {
    return vec3_add_scaled(hand->portal.position, depth, direction);
}

static enum result retreat_to(struct plan *plan, struct hand *hand, double depth) {
    if (hand_depth(hand) <= depth)
        return RESULT_OK;
    return plan_move(plan, hand, at_depth(hand, depth, hand_direction(hand, hand->tip)));
}

// ---- turning in the portal ----------------------------------------------------------------------

struct turn {
    vec3 start, axis;
    double angle;
};

static struct turn turn_to(const struct hand *hand, vec3 direction) {
    vec3 start = hand_direction(hand, hand->tip), axis = vec3_cross(start, direction);
    double angle = atan2(vec3_length(axis), vec3_dot(start, direction));
    return (struct turn){start, vec3_unit_or(axis, (vec3){1, 0, 0}), angle};
}

static vec3 turn_at(const struct turn *turn, double share) {
    return quat_rotate(quat_from_axis_angle(turn->axis, turn->angle * share), turn->start);
}

static bool can_turn(const struct plan *plan, const struct hand *hand, const struct turn *turn,
                     double depth, vec3 *out_blocked) {
    int looks = (int)ceil(turn->angle / look_angle) + 1;
    for (int i = 0; i <= looks; i++) {
        *out_blocked = at_depth(hand, depth, turn_at(turn, (double)i / looks));
        if (!plan_is_clear(plan, hand, *out_blocked))
            return false;
    }
    return true;
}

static enum result swing(struct plan *plan, struct hand *hand, const struct turn *turn) {
    double depth = hand_depth(hand);
    int rows = plan_rows(plan, turn->angle * depth, plan->script->speed_mm_s);
    for (int i = 1; i <= rows; i++) {
        hand->tip = at_depth(hand, depth, turn_at(turn, plan_progress(i, rows)));
        if (plan_add_row(plan, NULL) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}

enum result plan_turn(struct plan *plan, struct hand *hand, vec3 direction) {
    struct turn turn = turn_to(hand, direction);
    double inside = hand_depth(hand);
    vec3 blocked;
    for (int i = 0; i < DEPTH_COUNT; i++) {
        if (!can_turn(plan, hand, &turn, fmin(inside, depths[i]), &blocked))
            continue;
        enum result result = retreat_to(plan, hand, depths[i]);
        return result == RESULT_OK ? swing(plan, hand, &turn) : result;
    }
    return plan_refuse(plan, hand, blocked);
}

// ---- ways to a target ---------------------------------------------------------------------------

// Whatever is on the shaft's way to a tip that is clear, is clear as well: so the way back along
// the shaft and in again always leads there.
enum result plan_reach(struct plan *plan, struct hand *hand, vec3 target) {
    if (!plan_is_clear(plan, hand, target))
        return plan_refuse(plan, hand, target);
    if (plan_turn(plan, hand, hand_direction(hand, target)) != RESULT_OK)
        return RESULT_INVALID;
    return plan_move(plan, hand, target);
}

enum result plan_approach(struct plan *plan, struct hand *hand, vec3 target) {
    for (int i = 1; i <= approach_looks; i++) {
        vec3 p = vec3_lerp(hand->tip, target, (double)i / approach_looks);
        if (!plan_is_clear(plan, hand, p))
            return plan_reach(plan, hand, target);
    }
    return plan_move(plan, hand, target);
}

enum result plan_enter(struct plan *plan, struct hand *hand) {
    vec3 direction = hand->portal.direction;
    for (int i = 0; i < DEPTH_COUNT; i++) {
        vec3 tip = at_depth(hand, depths[i], direction);
        if (!plan_is_clear(plan, hand, tip))
            continue;
        hand->inside = true;
        return plan_move(plan, hand, tip);
    }
    return plan_refuse(plan, hand, at_depth(hand, depths[DEPTH_COUNT - 1], direction));
}

enum result plan_withdraw(struct plan *plan, struct hand *hand) {
    if (!hand->inside)
        return RESULT_OK;
    if (plan_turn(plan, hand, hand->portal.direction) != RESULT_OK ||
        plan_move(plan, hand, hand_rest(&hand->portal)) != RESULT_OK)
        return RESULT_INVALID;
    hand->inside = false;
    return RESULT_OK;
}

// ---- the joint ----------------------------------------------------------------------------------

static struct joint_angles joint_lerp(struct joint_angles a, struct joint_angles b, double t) {
    return (struct joint_angles){
        .flexion_deg = a.flexion_deg + t * (b.flexion_deg - a.flexion_deg),
        .varus_deg = a.varus_deg + t * (b.varus_deg - a.varus_deg),
        .internal_deg = a.internal_deg + t * (b.internal_deg - a.internal_deg),
        .shift_mm = a.shift_mm + t * (b.shift_mm - a.shift_mm),
        .drawer_mm = a.drawer_mm + t * (b.drawer_mm - a.drawer_mm),
        .distraction_mm = a.distraction_mm + t * (b.distraction_mm - a.distraction_mm)};
}

static struct joint_hold hold_lerp(struct joint_hold a, struct joint_hold b, double t) {
    return (struct joint_hold){.flexion_deg = a.flexion_deg + t * (b.flexion_deg - a.flexion_deg),
                               .valgus_deg = a.valgus_deg + t * (b.valgus_deg - a.valgus_deg),
                               .internal_deg =
                                   a.internal_deg + t * (b.internal_deg - a.internal_deg),
                               .drawer_mm = a.drawer_mm + t * (b.drawer_mm - a.drawer_mm)};
}

// Degrees; a millimetre of drawer counts as one.
static double hold_way(struct joint_hold a, struct joint_hold b) {
    return hypot(hypot(b.flexion_deg - a.flexion_deg, b.valgus_deg - a.valgus_deg),
                 hypot(b.internal_deg - a.internal_deg, b.drawer_mm - a.drawer_mm));
}

// The joint at about each degree of the way.
struct joint_way {
    int spans;
    struct joint_angles *keys; // spans + 1
};

static struct joint_way joint_way_to(const struct plan *plan, const struct joint_hold *to) {
    struct joint_way way = {.spans = (int)fmax(ceil(hold_way(plan->hold, *to)), 1)};
    way.keys = alloc((size_t)way.spans + 1, sizeof *way.keys);
    for (int i = 0; i <= way.spans; i++) {
        struct joint_hold hold = hold_lerp(plan->hold, *to, (double)i / way.spans);
        way.keys[i] =
            motion_joint(plan->knee, &plan->bones[BODY_FEMUR], &plan->bones[BODY_TIBIA], &hold);
    }
    return way;
}

// RESULT_INVALID where a bone comes to the shaft while the joint goes that way.
static enum result stays_clear(struct plan *plan, const struct hand *hand,
                               const struct joint_way *way, vec3 tip) {
    struct joint_angles now = plan->joint;
    enum result result = RESULT_OK;
    for (int i = 0; i <= way->spans && result == RESULT_OK; i++) {
        plan->joint = way->keys[i];
        if (!plan_is_clear(plan, hand, tip))
            result = plan_refuse(plan, hand, tip);
    }
    plan->joint = now;
    return result;
}

// Retreats as far as the bones need; where that is not enough, the shaft turns to how it came in.
static enum result make_room(struct plan *plan, struct hand *hand, const struct joint_way *way) {
    double inside = hand_depth(hand);
    vec3 directions[] = {hand_direction(hand, hand->tip), hand->portal.direction};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < DEPTH_COUNT; i++) {
            vec3 tip = at_depth(hand, fmin(inside, depths[i]), directions[k]);
            if (stays_clear(plan, hand, way, tip) != RESULT_OK)
                continue;
            enum result result = k ? plan_turn(plan, hand, directions[k]) : RESULT_OK;
            return result == RESULT_OK ? retreat_to(plan, hand, depths[i]) : result;
        }
    return RESULT_INVALID;
}

enum result plan_joint(struct plan *plan, const struct joint_hold *to) {
    struct joint_way way = joint_way_to(plan, to);
    enum result result = RESULT_OK;
    for (int i = 0; i < plan->motion->tool_count && result == RESULT_OK; i++)
        if (plan->hands[i].inside)
            result = make_room(plan, &plan->hands[i], &way);
    int rows = plan_rows(plan, hold_way(plan->hold, *to), plan->script->joint_speed_deg_s);
    for (int i = 1; i <= rows && result == RESULT_OK; i++) {
        double at = plan_progress(i, rows) * way.spans;
        int span = (int)fmin(at, way.spans - 1);
        plan->joint = joint_lerp(way.keys[span], way.keys[span + 1], at - span);
        result = plan_add_row(plan, NULL);
    }
    plan->hold = *to;
    free(way.keys);
    return result;
}
