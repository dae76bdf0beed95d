#include "motion/resect.h"

#include "base/check.h"
#include "motion/path.h"
#include "motion/way.h"

#include <stdlib.h>

static const double least_depth = 1.5; // of a bite that is worth it, mm
static const double bite_depth = 3.5;  // of the tip from the inner margin, mm
static const double bite_gain = 1.2;   // by which a round takes the margin back
static const double bite_spacing = 2;  // along the inner margin, mm
static const double half_jaw = 1.75;   // of the punch (cut/blade.h), mm
static const double burr_gap = 1;      // of a shaver's tip, mm
static const double trace_depth = 0.5; // from the inner margin, mm
static const double trace_step = 0.1;  // between points of the traced line, mm

// ---- the plan over the arc ----------------------------------------------------------------------

static bool is_planned_depth(const struct resection *r, double along, double depth) {
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
        if (is_planned_depth(r, along, d))
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
            plan_bites_at(plan, hand, *out_tip))
            return true;
    }
    return false;
}

static int bite_places(const struct resection *r) {
    double radius = arc_radius(r->arc, r->from) - arc_width(r->arc, r->from);
    double length = (r->to - r->from) * arc_angle(r->arc) * radius;
    return (int)fmax(1, round(length / bite_spacing));
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
    int places = bite_places(r), bites = 0, before, round_number = 0;
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
