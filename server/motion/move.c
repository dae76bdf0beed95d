#include "motion/move.h"

#include "base/check.h"

#include <stdlib.h>

static const double open_seconds = 0.5;
static const double bite_distance = 5;   // from where a bite begins, mm
static const double grasp_distance = 10; // a closed jaw there touches no loose body
static const double roll_speed = 4;      // degrees for each mm of a tip's way

pose plan_body_pose(const struct plan *plan, enum body body) {
    if (body == BODY_TIBIA)
        return joint_to_pose(&plan->knee->joint, &plan->joint);
    if (body == BODY_PATELLA)
        return case_patella_pose(plan->knee, plan->joint.flexion_deg);
    return pose_identity();
}

vec3 hand_rest(const struct case_portal *portal) {
    return vec3_add_scaled(portal->position, -MOTION_REST, portal->direction);
}

static bool is_before_portal(const struct hand *hand, vec3 tip) {
    return vec3_dot(vec3_sub(tip, hand->portal.position), hand->portal.direction) <= 0;
}

vec3 hand_direction(const struct hand *hand, vec3 tip) {
    if (is_before_portal(hand, tip))
        return hand->portal.direction;
    return vec3_unit_or(vec3_sub(tip, hand->portal.position), hand->portal.direction);
}

double hand_depth(const struct hand *hand) {
    return is_before_portal(hand, hand->tip) ? 0 : vec3_distance(hand->tip, hand->portal.position);
}

// ---- rows ---------------------------------------------------------------------------------------

// The deepest that the segment lies inside a bone, and in which.
static double depth_in_bones(const struct plan *plan, vec3 from, vec3 to, enum body *out_body) {
    double deepest = 0;
    for (enum body body = 0; body < BODY_COUNT; body++) {
        if (!plan->bones[body].mesh)
            continue;
        pose T = plan_body_pose(plan, body);
        double depth =
            solid_depth(&plan->bones[body], pose_apply_inverse(T, from), pose_apply_inverse(T, to));
        if (depth > deepest) {
            deepest = depth;
            *out_body = body;
        }
    }
    return deepest;
}

static bool is_within(const struct plan *plan, const struct hand *hand, vec3 tip, double depth) {
    enum body body;
    return depth_in_bones(plan, tip, hand->portal.position, &body) <= depth;
}

bool plan_is_clear(const struct plan *plan, const struct hand *hand, vec3 tip) {
    return is_within(plan, hand, tip, 0.8 * MOTION_DEPTH_MAX);
}

bool plan_bites_at(const struct plan *plan, const struct hand *hand, vec3 tip) {
    return plan_is_clear(plan, hand, tip) && plan_is_clear(plan, hand, plan_before_bite(hand, tip));
}

bool plan_sees(const struct plan *plan, vec3 from, vec3 to) {
    enum body body;
    double length = vec3_distance(from, to), share = fmax(1 - MOTION_SPARE / length, 0);
    return depth_in_bones(plan, from, vec3_lerp(from, to, share), &body) <= MOTION_DEPTH_MAX;
}

enum result plan_refuse(const struct plan *plan, const struct hand *hand, vec3 tip) {
    enum body body = BODY_FEMUR;
    double depth = depth_in_bones(plan, tip, hand->portal.position, &body);
    return fail(plan->err, RESULT_INVALID,
                "the shaft through the portal %s would run %.2f mm deep through the %s",
                hand->portal.name, depth, body_name(body));
}

// From the rotation before, the shorter way: no jump of sign or roll.
static quat turned_towards(quat before, vec3 direction) {
    vec3 z = quat_rotate(before, (vec3){0, 0, 1});
    vec3 cross = vec3_cross(z, direction);
    double sine = vec3_length(cross), angle = atan2(sine, vec3_dot(z, direction));
    if (angle < 1e-12)
        return before;
    vec3 aside = fabs(z.x) < 0.7 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    vec3 axis = vec3_unit_or(cross, vec3_unit_or(vec3_cross(z, aside), aside));
    return quat_unit(quat_multiply(quat_from_axis_angle(axis, angle), before));
}

// z along the shaft, y as far up as it allows: a punch opens away from the tibia.
static quat rolled_up(quat before, vec3 direction, vec3 up) {
    vec3 x = vec3_cross(up, direction);
    if (vec3_length(x) < 0.1)
        return turned_towards(before, direction);
    x = vec3_unit_or(x, x);
    vec3 y = vec3_cross(direction, x), z = direction;
    quat q = quat_from_mat3((mat3){{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}});
    double same = q.w * before.w + q.x * before.x + q.y * before.y + q.z * before.z;
    return same < 0 ? (quat){-q.w, -q.x, -q.y, -q.z} : q;
}

static quat rolled(quat rotation, double roll) {
    return quat_multiply(rotation, quat_from_axis_angle((vec3){0, 0, 1}, roll));
}

static struct motion_tool_state hand_state(struct hand *hand, double t, vec3 up) {
    vec3 shake = tremor_at(&hand->tremor, t);
    double depth = hand_depth(hand);
    vec3 tip = vec3_add_scaled(hand->tip, fmin(depth / MOTION_SAFE_DEPTH, 1), shake);
    hand->rotation = rolled_up(hand->rotation, hand_direction(hand, tip), up);
    return (struct motion_tool_state){{rolled(hand->rotation, hand->roll), tip}, hand->opening};
}

pose plan_tool_pose(const struct plan *plan, const struct hand *hand, vec3 tip, double roll) {
    quat up = rolled_up(hand->rotation, hand_direction(hand, tip), plan_up(plan));
    return (pose){rolled(up, roll), tip};
}

vec3 plan_up(const struct plan *plan) {
    quat joint = plan->knee->joint.T_tibia_joint.rotation;
    quat tibia = plan_body_pose(plan, BODY_TIBIA).rotation;
    return quat_rotate(quat_multiply(tibia, joint), (vec3){0, 0, 1});
}

enum result plan_add_row(struct plan *plan, const struct case_group *touch) {
    struct motion *motion = plan->motion;
    if (motion->row_count == plan->row_capacity) {
        plan->row_capacity = 2 * plan->row_capacity + 1024;
        motion->rows = alloc_resize(motion->rows, plan->row_capacity, sizeof *motion->rows);
    }
    struct motion_row *row = &motion->rows[motion->row_count];
    *row = (struct motion_row){.t_seconds = (double)motion->row_count / plan->script->rate_hz,
                               .joint = plan->joint,
                               .touch = touch};
    motion->row_count++;
    vec3 up = plan_up(plan);
    for (int i = 0; i < motion->tool_count; i++) {
        struct hand *hand = &plan->hands[i];
        if (hand->inside && !is_within(plan, hand, hand->tip, MOTION_DEPTH_MAX))
            return plan_refuse(plan, hand, hand->tip);
        row->tools[i] = hand_state(hand, row->t_seconds, up);
    }
    return RESULT_OK;
}

// ---- segments -----------------------------------------------------------------------------------

// Minimum jerk from 0 to 1: its highest speed is 15/8 of the mean.
double plan_progress(int row, int rows) {
    double t = (double)row / rows;
    return t * t * t * (10 - 15 * t + 6 * t * t);
}

int plan_rows(const struct plan *plan, double way, double highest_speed) {
    double seconds = 15.0 / 8 * way / highest_speed;
    return (int)fmax(ceil(seconds * plan->script->rate_hz), 1);
}

enum result plan_move(struct plan *plan, struct hand *hand, vec3 to) {
    vec3 from = hand->tip;
    int rows = plan_rows(plan, vec3_distance(from, to), plan->script->speed_mm_s);
    for (int i = 1; i <= rows; i++) {
        hand->tip = vec3_lerp(from, to, plan_progress(i, rows));
        if (plan_add_row(plan, NULL) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}

enum result plan_roll(struct plan *plan, struct hand *hand, double roll) {
    double from = hand->roll, way = DEG_PER_RAD * fabs(roll - from);
    int rows = plan_rows(plan, way, roll_speed * plan->script->speed_mm_s);
    for (int i = 1; way > 0 && i <= rows; i++) {
        hand->roll = from + (roll - from) * plan_progress(i, rows);
        if (plan_add_row(plan, NULL) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}

enum result plan_open(struct plan *plan, struct hand *hand, double opening) {
    double from = hand->opening;
    int rows = (int)ceil(open_seconds * plan->script->rate_hz);
    for (int i = 1; i <= rows; i++) {
        hand->opening = from + (opening - from) * plan_progress(i, rows);
        if (plan_add_row(plan, NULL) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}

static vec3 before(const struct hand *hand, vec3 target, double distance) {
    return vec3_add_scaled(target, -distance, hand_direction(hand, target));
}

vec3 plan_before_bite(const struct hand *hand, vec3 target) {
    return before(hand, target, bite_distance);
}

vec3 plan_before_grasp(const struct hand *hand, vec3 target) {
    return before(hand, target, grasp_distance);
}

enum result plan_grasp(struct plan *plan, struct hand *hand, vec3 target) {
    if (plan_open(plan, hand, 1) != RESULT_OK || plan_move(plan, hand, target) != RESULT_OK)
        return RESULT_INVALID;
    return plan_open(plan, hand, 0);
}

enum result plan_bite(struct plan *plan, struct hand *hand, vec3 target) {
    vec3 from = hand->tip;
    if (plan_grasp(plan, hand, target) != RESULT_OK)
        return RESULT_INVALID;
    return plan_move(plan, hand, from);
}
