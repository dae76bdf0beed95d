#include "motion/resect.h"

#include "base/check.h"
#include "motion/path.h"
#include "motion/way.h"

#include <stdlib.h>

static const double least_depth = 1.5;  // of a bite that is worth it, mm
static const double bite_depth = 3.5;   // of the tip from the inner margin, mm
static const double least_left = 0.5;   // mm of what is left that is worth a bite
static const double jaw_reach = 4.5;    // of the jaws, which are 6 mm long, that is worth a bite
static const double most_off = 0.6;     // mm
static const double left_spacing = 1.4; // along the inner margin, mm
static const double corner_spare = 1.2; // mm by which a corner may reach beyond it
static const double half_turn = 180 * RAD_PER_DEG;
static const double bite_gain = 1.2;   // by which a round takes the margin back
static const double bite_spacing = 2;  // along the inner margin, mm
static const double half_jaw = 1.75;   // of the punch (cut/blade.h), mm
static const double burr_gap = 1;      // of a shaver's tip, mm
static const double trace_depth = 0.5; // from the inner margin, mm
static const double trace_step = 0.1;  // between points of the traced line, mm

// ---- the plan over the arc ----------------------------------------------------------------------

static bool is_planned(const struct resection *r, double along, double depth) {
    double inward = arc_width(r->arc, along) - depth, lower, upper;
    arc_heights(r->arc, along, inward, &lower, &upper);
    vec3 p = arc_point(r->arc, (struct arc_place){along, inward, (lower + upper) / 2});
    for (int i = 0; i < r->group->lesion.plan.part_count; i++)
        if (convex_contains(&r->group->lesion.plan.parts[i], p))
            return true;
    return false;
}

static double planned_depth(const struct resection *r, double along) {
    double depth = 0;
    for (double d = 0.1; d < arc_width(r->arc, along); d += 0.1)
        if (is_planned(r, along, d))
            depth = d;
    return depth;
}

static void measure_plan(struct resection *r) {
    r->from = 1;
    r->to = 0;
    for (int i = 0; i <= RESECTION_SAMPLES; i++) {
        double along = (double)i / RESECTION_SAMPLES;
        r->depths[i] = planned_depth(r, along);
        if (r->depths[i] < least_depth)
            continue;
        r->from = fmin(r->from, along);
        r->to = fmax(r->to, along);
    }
}

enum result resection_init(struct resection *r, const struct knee_case *knee,
                           const struct case_group *group, struct error *err) {
    *r = (struct resection){.group = group};
    if (group->lesion.plan.part_count == 0)
        return fail(err, RESULT_MISSING, "%s has no planned resection", group->name);
    case_group_virtual(group, &r->whole);
    pose T_body_joint =
        group->body == BODY_TIBIA ? knee->joint.T_tibia_joint : knee->joint.T_femur_joint;
    enum result result = query_create(&r->whole, &r->query, err);
    if (result == RESULT_OK)
        result = arc_create(&r->whole, T_body_joint, &r->arc, err);
    if (result == RESULT_OK)
        measure_plan(r);
    if (result == RESULT_OK && r->from >= r->to)
        result = fail(err, RESULT_INVALID,
                      "the planned resection of %s does not reach its inner margin", group->name);
    return result;
}

void resection_fini(struct resection *r) {
    arc_destroy(&r->arc);
    query_destroy(&r->query);
    mesh_fini(&r->whole);
}

// ---- what is still there ------------------------------------------------------------------------

static const double left_step = 0.2;                  // mm
static const double left_heights[] = {0.2, 0.5, 0.8}; // shares of the tissue's height

static bool is_there(const struct resection *r, const struct solid *now, double along,
                     double depth) {
    double inward = arc_width(r->arc, along) - depth, lower, upper;
    arc_heights(r->arc, along, inward, &lower, &upper);
    for (size_t i = 0; i < sizeof left_heights / sizeof *left_heights; i++) {
        double height = lower + left_heights[i] * (upper - lower);
        uint32_t hint = MESH_NONE;
        vec3 p = arc_point(r->arc, (struct arc_place){along, inward, height});
        if (solid_distance(now, p, &hint) < 0)
            return true;
    }
    return false;
}

static void measure_left(const struct resection *r, const struct solid *now,
                         struct motion_left *out) {
    for (int i = 0; i <= RESECTION_SAMPLES; i++) {
        double margin = left_step / 2;
        while (margin < r->depths[i] && !is_there(r, now, (double)i / RESECTION_SAMPLES, margin))
            margin += left_step;
        out->margin_mm[i] = margin;
        out->depth_mm[i] = fmax(r->depths[i] - margin, 0);
    }
}

enum result motion_left(struct knee_case *knee, const char *name, const struct mesh *now,
                        struct motion_left *out_left, struct error *err) {
    struct resection r;
    struct solid solid = {0};
    const struct case_group *group = case_group(knee, name);
    if (!group)
        return fail(err, RESULT_MISSING, "the case has no group %s", name);
    enum result result = resection_init(&r, knee, group, err);
    if (result == RESULT_OK)
        result = solid_init(&solid, now, err);
    if (result == RESULT_OK)
        measure_left(&r, &solid, out_left);
    solid_fini(&solid);
    resection_fini(&r);
    return result;
}

// ---- places on the mock-up ----------------------------------------------------------------------

// The point of S that becomes the nearest point of S', in the femur's frame of the moment.
static vec3 on_mockup(const struct resection *r, const struct plan *plan, vec3 p) {
    struct closest closest;
    bool found = query_closest(r->query, p, INFINITY, MESH_NONE, &closest);
    CHECK(found);
    vec3 point = {0};
    for (int i = 0; i < 3; i++)
        point = vec3_add_scaled(point, closest.weights[i],
                                mesh_corner(&r->group->mesh, closest.triangle, i));
    return pose_apply(plan_body_pose(plan, r->group->body), point);
}

// On the lower or the upper side, so deep from the inner margin.
static vec3 on_side(const struct resection *r, const struct plan *plan, double along, double depth,
                    bool is_upper) {
    double inward = arc_width(r->arc, along) - depth, lower, upper;
    arc_heights(r->arc, along, inward, &lower, &upper);
    struct arc_place place = {along, inward, is_upper ? upper : lower};
    return on_mockup(r, plan, arc_point(r->arc, place));
}

// ---- bites --------------------------------------------------------------------------------------

static double depth_at(const struct resection *r, double along) {
    return r->depths[(int)lround(along * RESECTION_SAMPLES)];
}

// How much deeper than the tip a corner of the jaws reaches where the shaft is oblique.
static double corner_reach(const struct resection *r, const struct plan *plan,
                           const struct hand *hand, double along, vec3 tip) {
    pose T = plan_body_pose(plan, r->group->body);
    vec3 outward = quat_rotate(T.rotation, arc_outward(r->arc, along));
    vec3 up = quat_rotate(T.rotation, arc_up(r->arc));
    vec3 aside = vec3_unit_or(vec3_cross(up, hand_direction(hand, tip)), up);
    return half_jaw * fabs(vec3_dot(aside, outward));
}

// The tip under the meniscus, so deep that the jaws stay within what is still planned there after
// so many rounds. False where that is not worth a bite or the shaft does not come there.
static bool find_bite(const struct resection *r, struct plan *plan, const struct hand *hand,
                      double along, int round, vec3 *out_tip) {
    double left = depth_at(r, along) - round * bite_gain;
    for (double depth = fmin(bite_depth, left); depth >= least_depth; depth -= 0.2) {
        *out_tip = on_side(r, plan, along, depth, false);
        if (depth + corner_reach(r, plan, hand, along, *out_tip) <= left &&
            plan_is_clear(plan, hand, *out_tip) &&
            plan_is_clear(plan, hand, plan_before_bite(hand, *out_tip)))
            return true;
    }
    return false;
}

static int bite_places(const struct resection *r, double spacing) {
    double radius = arc_radius(r->arc, r->from) - arc_width(r->arc, r->from);
    double length = (r->to - r->from) * arc_angle(r->arc) * radius;
    return (int)fmax(1, round(length / spacing));
}

static double bite_along(const struct resection *r, int place, int places) {
    return r->from + (r->to - r->from) * (place + 0.5) / places;
}

static enum result no_bite(const struct resection *r, struct plan *plan, const struct hand *hand) {
    return fail(plan->err, RESULT_INVALID,
                "no place of the planned resection of %s can be reached from the portal %s",
                r->group->name, hand->portal.name);
}

enum result resection_bite(const struct resection *r, struct plan *plan, struct hand *hand,
                           int count) {
    int places = bite_places(r, bite_spacing), bites = 0, before, round_number = 0;
    do {
        before = bites;
        for (int i = 0; i < places && bites < count; i++) {
            vec3 tip;
            if (!find_bite(r, plan, hand, bite_along(r, i, places), round_number, &tip))
                continue;
            if (plan_approach(plan, hand, plan_before_bite(hand, tip)) != RESULT_OK ||
                plan_bite(plan, hand, tip) != RESULT_OK)
                return RESULT_INVALID;
            bites++;
        }
        round_number++;
    } while (bites > before && bites < count);
    return bites > 0 ? RESULT_OK : no_bite(r, plan, hand);
}

static bool bites_at(const struct plan *plan, const struct hand *hand, vec3 tip) {
    return plan_is_clear(plan, hand, tip) && plan_is_clear(plan, hand, plan_before_bite(hand, tip));
}

// As far off the tissue as bones let, so that the jaw that does not move passes by its margin.
static bool get_off(const struct resection *r, const struct plan *plan, const struct hand *hand,
                    bool is_upper, vec3 *tip) {
    vec3 up = quat_rotate(plan_body_pose(plan, r->group->body).rotation, arc_up(r->arc)), at = *tip;
    for (double off = most_off; off >= 0; off -= most_off / 3) {
        *tip = vec3_add_scaled(at, is_upper ? off : -off, up);
        if (bites_at(plan, hand, *tip))
            return true;
    }
    return false;
}

// How far from the margin a tip may be for the jaws to reach back to it along an oblique shaft.
static double jaw_depth(const struct resection *r, const struct plan *plan, const struct hand *hand,
                        double along) {
    vec3 at = on_side(r, plan, along, bite_depth, false);
    quat turn = plan_body_pose(plan, r->group->body).rotation;
    return jaw_reach *
           vec3_dot(hand_direction(hand, at), quat_rotate(turn, arc_outward(r->arc, along)));
}

// What is left lies behind a margin that has come back, but the hand bites at the mock-up's, which
// has not: there the rest of the width is stretched over the whole of it.
static bool find_bite_left(const struct resection *r, struct plan *plan, const struct hand *hand,
                           const struct motion_left *left, bool is_upper, double along,
                           vec3 *out_tip) {
    int i = (int)lround(along * RESECTION_SAMPLES);
    double width = arc_width(r->arc, along), stretch = width / (width - left->margin_mm[i]);
    double most = fmin(left->depth_mm[i], jaw_depth(r, plan, hand, along));
    for (double depth = fmin(bite_depth, most); depth >= least_left; depth -= 0.2) {
        *out_tip = on_side(r, plan, along, fmin(depth * stretch, width - 1), is_upper);
        if (depth + corner_reach(r, plan, hand, along, *out_tip) <=
                left->depth_mm[i] + corner_spare &&
            get_off(r, plan, hand, is_upper, out_tip))
            return true;
    }
    return false;
}

static enum result bite_left(const struct resection *r, struct plan *plan, struct hand *hand,
                             const struct motion_left *left, bool is_upper, int count) {
    int places = bite_places(r, left_spacing), bites = 0;
    for (int i = 0; i < places && bites < count; i++) {
        vec3 tip;
        if (!find_bite_left(r, plan, hand, left, is_upper, bite_along(r, i, places), &tip))
            continue;
        if (plan_approach(plan, hand, plan_before_bite(hand, tip)) != RESULT_OK ||
            plan_bite(plan, hand, tip) != RESULT_OK)
            return RESULT_INVALID;
        bites++;
    }
    return bites > 0 ? RESULT_OK : no_bite(r, plan, hand);
}

enum result resection_bite_left(const struct resection *r, struct plan *plan, struct hand *hand,
                                const struct motion_left *left, bool is_upper, int count) {
    enum result result = plan_roll(plan, hand, is_upper ? half_turn : 0);
    if (result == RESULT_OK)
        result = bite_left(r, plan, hand, left, is_upper, count);
    return result == RESULT_OK ? plan_roll(plan, hand, 0) : result;
}

// ---- a way along the margin ---------------------------------------------------------------------

// The probe goes on the upper side. A shaver's burr is thick: its tip keeps off the inner margin.
static vec3 traced_point(const struct resection *r, const struct plan *plan,
                         const struct hand *hand, double along) {
    vec3 upper = on_side(r, plan, along, trace_depth, true);
    if (hand->channel != CHANNEL_SHAVER)
        return upper;
    vec3 middle = vec3_lerp(upper, on_side(r, plan, along, trace_depth, false), 0.5);
    vec3 outward =
        quat_rotate(plan_body_pose(plan, r->group->body).rotation, arc_outward(r->arc, along));
    return vec3_add_scaled(middle, -trace_depth - burr_gap, outward);
}

static void margin_line(struct tip_path *line, const struct resection *r, struct plan *plan,
                        const struct hand *hand) {
    double radius = arc_radius(r->arc, (r->from + r->to) / 2);
    int count = (int)ceil((r->to - r->from) * arc_angle(r->arc) * radius / trace_step) + 1;
    for (int i = 0; i < count; i++)
        tip_path_add(line,
                     traced_point(r, plan, hand, r->from + (r->to - r->from) * i / (count - 1)));
}

static enum result shave(struct plan *plan, struct hand *hand, const struct tip_path *line) {
    enum result result = plan_reach(plan, hand, line->points[0]);
    hand->opening = 1;
    if (result == RESULT_OK)
        result = tip_path_pass(plan, hand, line);
    hand->opening = 0;
    return result;
}

static enum result feel(const struct resection *r, struct plan *plan, struct hand *hand,
                        struct tip_path *line) {
    struct query *surface;
    enum result result = query_create(&r->group->mesh, &surface, plan->err);
    if (result == RESULT_OK)
        result = plan_reach(plan, hand, line->points[0]);
    pose T = plan_body_pose(plan, r->group->body);
    for (int i = 0; i < line->count; i++)
        line->points[i] = pose_apply_inverse(T, line->points[i]);
    if (result == RESULT_OK)
        result = tip_path_slide(plan, hand, r->group, surface, line);
    query_destroy(&surface);
    return result;
}

enum result resection_trace(const struct resection *r, struct plan *plan, struct hand *hand) {
    struct tip_path line = {0};
    enum result result = RESULT_OK;
    margin_line(&line, r, plan, hand);
    tip_path_keep_reached(&line, plan, hand, pose_identity());
    if (line.count < 2)
        result =
            fail(plan->err, RESULT_INVALID, "the margin of %s cannot be reached from the portal %s",
                 r->group->name, hand->portal.name);
    else
        result =
            hand->channel == CHANNEL_SHAVER ? shave(plan, hand, &line) : feel(r, plan, hand, &line);
    tip_path_fini(&line);
    return result;
}
