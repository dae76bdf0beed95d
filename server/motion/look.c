#include "motion/look.h"

#include "motion/place.h"
#include "motion/way.h"

static const double look_distances[] = {18, 22, 14, 26, 10, 30}; // to what the scope looks at, mm

static bool is_planned_at(const struct case_group *group, vec3 p) {
    for (int i = 0; i < group->lesion.plan.part_count; i++)
        if (convex_contains(&group->lesion.plan.parts[i], p))
            return true;
    return false;
}

// What there is to see of a group: where its resection is planned, or else its middle.
static vec3 sight_of(const struct case_group *group) {
    struct box box = mesh_bounds(&group->mesh);
    vec3 sum = {0};
    int count = 0;
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&group->mesh, v);
        if (is_planned_at(group, p)) {
            sum = vec3_add(sum, p);
            count++;
        }
    }
    return count ? vec3_scale(1.0 / count, sum) : vec3_lerp(box.min, box.max, 0.5);
}

// Where the tip sees the point straight ahead through an optic that is tilted up by so much: the
// shaft's direction follows from the tip and the tip from it.
static vec3 look_from(const struct plan *plan, const struct hand *hand, vec3 point, double distance,
                      double tilt) {
    vec3 tip = vec3_add_scaled(point, -distance, hand_direction(hand, point));
    for (int i = 0; i < 20; i++) {
        vec3 shaft = hand_direction(hand, tip);
        vec3 aside = vec3_unit_or(vec3_cross(shaft, plan_up(plan)), (vec3){1, 0, 0});
        vec3 sight = quat_rotate(quat_from_axis_angle(aside, tilt), shaft);
        tip = vec3_add_scaled(point, -distance, sight);
    }
    return tip;
}

// A tip so far away from which the point is straight ahead and, where it has to be, no bone hides
// it.
static bool look_at(const struct plan *plan, const struct hand *hand, vec3 point, double distance,
                    bool seen, vec3 *out_tip) {
    for (int i = 6; i >= 0; i--) {
        double tilt = plan->script->optic_deg * RAD_PER_DEG * i / 6;
        *out_tip = look_from(plan, hand, point, distance, tilt);
        if (plan_is_clear(plan, hand, *out_tip) && (!seen || plan_sees(plan, *out_tip, point)))
            return true;
    }
    return false;
}

// distance: 0 for any.
static bool find_look(const struct plan *plan, const struct hand *hand, vec3 point, double distance,
                      bool seen, vec3 *out_tip) {
    if (distance > 0)
        return look_at(plan, hand, point, distance, seen, out_tip);
    for (size_t i = 0; i < sizeof look_distances / sizeof *look_distances; i++)
        if (look_at(plan, hand, point, look_distances[i], seen, out_tip))
            return true;
    return false;
}

static enum result look_there(struct plan *plan, struct hand *hand, vec3 tip, double roll) {
    enum result result = plan_roll(plan, hand, roll);
    return result == RESULT_OK ? plan_reach(plan, hand, tip) : result;
}

enum result look_to(struct plan *plan, struct hand *hand, const struct motion_step *step,
                    const struct case_group *group) {
    pose T = plan_body_pose(plan, group->body);
    if (step->is_free)
        return look_there(plan, hand, pose_apply(T, step->from.at), RAD_PER_DEG * step->roll_deg);
    vec3 seen = sight_of(group), tip;
    if (step->has_place && place_find(plan->knee, &step->from, &seen, plan->err) != RESULT_OK)
        return RESULT_MISSING;
    vec3 point = pose_apply(T, seen);
    if (!find_look(plan, hand, point, step->amount, true, &tip) &&
        !find_look(plan, hand, point, step->amount, false, &tip))
        return fail_in(plan->err, plan_refuse(plan, hand, tip), "%s cannot be seen: ", group->name);
    return look_there(plan, hand, tip, 0);
}

// ---- turning the optic --------------------------------------------------------------------------

static const double stand_least = 8, stand_most = 34, stand_step = 3; // mm
static const double stand_cone_deg = 60, stand_step_deg = 4;
static const double stand_off_deg = 25; // of a place from the middle of the picture

// Femur's frame. A landmark is on its own body, a point on that of the group.
static enum result find_place(const struct plan *plan, const struct case_group *group,
                              const struct motion_place *place, vec3 *out_point) {
    const struct case_landmark *landmark = case_landmark(plan->knee, place->landmark);
    if (place_find(plan->knee, place, out_point, plan->err) != RESULT_OK)
        return RESULT_MISSING;
    enum body body = landmark ? landmark->body : group->body;
    *out_point = pose_apply(plan_body_pose(plan, body), *out_point);
    return RESULT_OK;
}

// How far from the middle of the picture the place stays as the optic turns; INFINITY where it is
// too near or too far away.
static double off_middle_deg(const struct plan *plan, const struct hand *hand, vec3 tip,
                             vec3 place) {
    vec3 way = vec3_sub(place, tip), shaft = hand_direction(hand, tip);
    double distance = vec3_length(way);
    if (distance < stand_least || distance > stand_most)
        return INFINITY;
    double angle = atan2(vec3_length(vec3_cross(shaft, way)), vec3_dot(shaft, way));
    return fabs(DEG_PER_RAD * angle - plan->script->optic_deg);
}

struct stand {
    vec3 tip;
    double off_deg;
};

static void try_stand(const struct plan *plan, const struct hand *hand, const vec3 places[2],
                      vec3 tip, struct stand *best) {
    double off = fmax(off_middle_deg(plan, hand, tip, places[0]),
                      off_middle_deg(plan, hand, tip, places[1]));
    if (off < best->off_deg && plan_is_clear(plan, hand, tip) && plan_sees(plan, tip, places[0]) &&
        plan_sees(plan, tip, places[1]))
        *best = (struct stand){tip, off};
}

// Directions through the portal in rings about its own, and depths along each.
static struct stand find_stand(const struct plan *plan, const struct hand *hand,
                               const vec3 places[2]) {
    struct stand best = {.off_deg = stand_off_deg};
    vec3 straight = hand->portal.direction;
    vec3 aside = vec3_unit_or(vec3_cross(straight, plan_up(plan)), (vec3){1, 0, 0});
    for (double ring = 0; ring <= stand_cone_deg; ring += stand_step_deg)
        for (double turn = 0; turn < 360; turn += fmax(stand_step_deg, 360 - 60 * ring)) {
            vec3 out = quat_rotate(quat_from_axis_angle(straight, turn * RAD_PER_DEG), aside);
            vec3 way = quat_rotate(quat_from_axis_angle(out, ring * RAD_PER_DEG), straight);
            for (double depth = stand_step; depth < 80; depth += stand_step)
                try_stand(plan, hand, places, vec3_add_scaled(hand->portal.position, depth, way),
                          &best);
        }
    return best;
}

enum result look_stand(struct plan *plan, struct hand *hand, const struct motion_step *step,
                       const struct case_group *group) {
    vec3 places[2];
    if (find_place(plan, group, &step->from, &places[0]) != RESULT_OK ||
        find_place(plan, group, &step->to, &places[1]) != RESULT_OK)
        return RESULT_MISSING;
    struct stand stand = find_stand(plan, hand, places);
    if (stand.off_deg < stand_off_deg)
        return plan_reach(plan, hand, stand.tip);
    char from[PLACE_NAME_MAX], to[PLACE_NAME_MAX];
    return fail(plan->err, RESULT_INVALID,
                "through the portal %s, from nowhere does the optic turn from %s to %s",
                hand->portal.name, place_name(&step->from, from), place_name(&step->to, to));
}

enum result look_turn(struct plan *plan, struct hand *hand, const struct motion_step *step,
                      const struct case_group *group) {
    vec3 place;
    if (find_place(plan, group, &step->from, &place) != RESULT_OK)
        return RESULT_MISSING;
    vec3 way = quat_rotate(quat_conjugate(hand->rotation), vec3_sub(place, hand->tip));
    return plan_roll(plan, hand, atan2(-way.x, way.y));
}
