#include "cut/blade.h"

#include "base/check.h"

// An upper jaw turns about a hinge on the shaft's axis, from the closed lower jaw towards y. It
// takes tissue between jaw_root and its length from the hinge.
static const double jaw_root = 1;
static const double jaw_tremor_mm = 0.5; // what goes farther between two moves bites anew

// A blade that turns is swept in parts, each turning by no more than this, where there are enough.
static const double blade_part_deg = 2;
static const double loose_part_deg = 1; // without the faces of where a part begins and ends

// Of a blade: its kerf is along x.
static vec3 blade_low(const struct instrument *blade) {
    return (vec3){-blade->thickness_mm / 2, -blade->width_mm / 2, -blade->length_mm};
}

static vec3 blade_high(const struct instrument *blade) {
    return (vec3){blade->thickness_mm / 2, blade->width_mm / 2, 0};
}

static vec3 jaw_direction(const struct instrument *jaw, double opening) {
    double angle = opening * jaw->opening_deg * RAD_PER_DEG;
    return (vec3){0, sin(angle), cos(angle)};
}

// With room for what encloses a ball, and for a blade that turns.
double blade_reach_mm(const struct instrument *instrument) {
    switch (instrument->kind) {
    case INSTRUMENT_JAW: {
        vec3 open = vec3_scale(instrument->length_mm, jaw_direction(instrument, 1));
        vec3 corner = {instrument->width_mm / 2, open.y, open.z - instrument->length_mm};
        double root = hypot(instrument->length_mm, instrument->width_mm / 2);
        return fmax(instrument->length_mm + 0.5, fmax(vec3_length(corner), root));
    }
    case INSTRUMENT_BURR:
        return fmax(instrument->width_mm + 0.5, 1.125 * instrument->width_mm);
    default:
        return fmax(instrument->length_mm + 0.5, 1.05 * vec3_length(blade_low(instrument)) + 0.05);
    }
}

// ---- planes around points -----------------------------------------------------------------------

struct blade_hull {
    vec3 points[16];
    int point_count;
    vec3 normals[CONVEX_PLANES_MAX];
    int normal_count;
};

// A direction that is there already, but for a hair, would only make a face without width.
static void add_normal(struct blade_hull *body, vec3 direction) {
    vec3 none = {0}, normal = vec3_unit_or(direction, none);
    if (vec3_length(normal) < 0.5)
        return;
    for (int i = 0; i < body->normal_count; i++)
        if (vec3_distance(body->normals[i], normal) < 1e-3)
            return;
    body->normals[body->normal_count++] = normal;
}

static void add_both(struct blade_hull *body, vec3 direction) {
    add_normal(body, direction);
    add_normal(body, vec3_scale(-1, direction));
}

static bool finish(const struct blade_hull *body, double thickness, struct convex *out_part,
                   struct error *err) {
    struct plane planes[CONVEX_PLANES_MAX];
    convex_supports(body->points, body->point_count, body->normals, body->normal_count, planes);
    for (int i = 0; i < body->normal_count; i++)
        planes[i].offset += thickness;
    return convex_create(planes, body->normal_count, out_part, err) == RESULT_OK;
}

static int one_part(bool made) {
    return made ? 1 : -1;
}

// ---- the three blades ---------------------------------------------------------------------------

// How far the jaw's farthest point has gone from one pose to the other.
static double jaw_way_mm(const struct instrument *jaw, pose from, pose to) {
    double half_width = jaw->width_mm / 2;
    double farthest = 0;
    for (int i = 0; i < 4; i++) {
        vec3 p = {i & 1 ? half_width : -half_width, 0, i & 2 ? 0 : -jaw->length_mm};
        farthest = fmax(farthest, vec3_distance(pose_apply(from, p), pose_apply(to, p)));
    }
    return farthest;
}

// A wedge about the hinge, from the opening before to that after. A hand that trembles as it closes
// the jaw leaves no film between one move and the next: the wedge goes back to where the jaw was.
static int jaw_parts(const struct instrument *jaw, const struct blade_move *move, bool tightly,
                     struct convex *out_parts, struct error *err) {
    (void)tightly;
    double high = move->opening[0], low = move->opening[1];
    double length = jaw->length_mm, half_width = jaw->width_mm / 2;
    if (high - low < 1e-3)
        return 0;
    pose at = move->T_mesh_tip[1];
    vec3 hinge = {0, 0, -length};
    vec3 directions[3] = {jaw_direction(jaw, low), jaw_direction(jaw, (low + high) / 2),
                          jaw_direction(jaw, high)};
    struct blade_hull body = {0};
    for (int i = 0; i < 3; i++)
        for (int side = -1; side <= 1; side += 2) {
            vec3 beside = {side * half_width, 0, 0};
            vec3 from = vec3_add(hinge, beside);
            body.points[body.point_count++] =
                pose_apply(at, vec3_add_scaled(from, jaw_root, directions[i]));
            body.points[body.point_count++] =
                pose_apply(at, vec3_add_scaled(from, length, directions[i]));
        }
    bool trembled = jaw_way_mm(jaw, move->T_mesh_tip[0], at) < jaw_tremor_mm;
    for (int i = 0; i < 4 && trembled; i++) {
        vec3 from = {i & 1 ? half_width : -half_width, 0, -length};
        vec3 p = vec3_add_scaled(from, i & 2 ? jaw_root : length, directions[2]);
        body.points[body.point_count++] = pose_apply(move->T_mesh_tip[0], p);
    }
    vec3 across = {1, 0, 0};
    add_both(&body, quat_rotate(at.rotation, across));
    add_normal(&body, quat_rotate(at.rotation, vec3_cross(across, directions[0])));
    add_normal(&body, quat_rotate(at.rotation, vec3_cross(directions[2], across)));
    add_normal(&body, quat_rotate(at.rotation, vec3_scale(-1, directions[1])));
    add_normal(&body, quat_rotate(at.rotation, vec3_add(directions[0], directions[1])));
    add_normal(&body, quat_rotate(at.rotation, vec3_add(directions[1], directions[2])));
    return one_part(finish(&body, 0, out_parts, err));
}

// Directions of a ball whose rings stand across `axis`, so that sweeping it along the axis makes a
// prism and no more.
static void add_ball(struct blade_hull *body, vec3 axis) {
    static const struct {
        double latitude_deg;
        int count;
    } rings[] = {{0, 12}, {32, 10}, {-32, 10}, {62, 6}, {-62, 6}};
    vec3 helper = fabs(axis.x) < 0.6 ? (vec3){1, 0, 0} : (vec3){0, 1, 0};
    vec3 u = vec3_unit_or(vec3_cross(axis, helper), helper), v = vec3_cross(axis, u);
    for (int r = 0; r < 5; r++)
        for (int i = 0; i < rings[r].count; i++) {
            double up = sin(rings[r].latitude_deg * RAD_PER_DEG);
            double out = cos(rings[r].latitude_deg * RAD_PER_DEG);
            double turn = 2 * M_PI * (i + 0.25 * r) / rings[r].count;
            vec3 ring = vec3_add_scaled(vec3_scale(cos(turn), u), sin(turn), v);
            add_normal(body, vec3_add_scaled(vec3_scale(out, ring), up, axis));
        }
    add_both(body, axis);
}

static int burr_parts(const struct instrument *burr, const struct blade_move *move, bool tightly,
                      struct convex *out_parts, struct error *err) {
    (void)tightly;
    double radius = burr->width_mm / 2;
    struct blade_hull body = {.point_count = 2};
    vec3 shaft = quat_rotate(move->T_mesh_tip[1].rotation, (vec3){0, 0, 1});
    for (int i = 0; i < 2; i++)
        body.points[i] = pose_apply(move->T_mesh_tip[i], (vec3){0, 0, -radius});
    vec3 way = vec3_sub(body.points[1], body.points[0]);
    add_ball(&body, vec3_length(way) < 0.02 ? shaft : vec3_unit_or(way, shaft));
    return one_part(finish(&body, radius, out_parts, err));
}

// Exact for a straight move; for one that turns an outer bound.
static bool sweep_blade(const struct instrument *blade, pose from, pose to, bool tightly,
                        struct convex *out_part, struct error *err) {
    struct blade_hull body = {0};
    vec3 low = blade_low(blade), high = blade_high(blade);
    for (int end = 0; end < 2; end++)
        for (int i = 0; i < 8; i++) {
            vec3 corner = {(i & 1 ? high : low).x, (i & 2 ? high : low).y, (i & 4 ? high : low).z};
            body.points[body.point_count++] = pose_apply(end ? to : from, corner);
        }
    pose middle = pose_interpolate(from, to, 0.5);
    vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 3; i++)
        add_both(&body, quat_rotate(middle.rotation, axes[i]));
    for (int i = 0; i < 3 && tightly; i++) {
        add_both(&body, quat_rotate(from.rotation, axes[i]));
        add_both(&body, quat_rotate(to.rotation, axes[i]));
    }
    vec3 way = vec3_sub(to.translation, from.translation);
    for (int i = 0; i < 3 && vec3_length(way) > 1e-3; i++)
        add_both(&body, vec3_cross(quat_rotate(middle.rotation, axes[i]), way));
    return finish(&body, 0, out_part, err);
}

static int swept_parts(const struct instrument *blade, const struct blade_move *move, bool tightly,
                       struct convex *out_parts, struct error *err) {
    const pose *at = move->T_mesh_tip;
    double turn_deg = quat_angle(at[0].rotation, at[1].rotation) * DEG_PER_RAD;
    double part_deg = tightly ? blade_part_deg : loose_part_deg;
    int steps = (int)fmin(CUT_PARTS_MAX, 1 + turn_deg / part_deg);
    for (int i = 0; i < steps; i++)
        if (!sweep_blade(blade, pose_interpolate(at[0], at[1], (double)i / steps),
                         pose_interpolate(at[0], at[1], (i + 1.0) / steps), tightly, &out_parts[i],
                         err))
            return -1;
    return steps;
}

int blade_parts(const struct instruments *instruments, const struct blade_move *move, bool tightly,
                struct convex out_parts[CUT_PARTS_MAX], struct error *err) {
    CHECK(pose_is_valid(move->T_mesh_tip[0]) && pose_is_valid(move->T_mesh_tip[1]));
    static int (*const parts_of[INSTRUMENT_KIND_COUNT])(
        const struct instrument *, const struct blade_move *, bool, struct convex *,
        struct error *) = {[INSTRUMENT_JAW] = jaw_parts,
                           [INSTRUMENT_BURR] = burr_parts,
                           [INSTRUMENT_BLADE] = swept_parts};
    int index = instrument_of_blade(move->blade);
    CHECK(index >= 0 && index < instruments->count);
    const struct instrument *tool = &instruments->of[index];
    CHECK(instrument_cuts(tool));
    int count = parts_of[tool->kind](tool, move, tightly, out_parts, err);
    vec3 tip = move->T_mesh_tip[1].translation;
    if (count < 0)
        fail_in(err, RESULT_INVALID, "the %s at %.1f,%.1f,%.1f: ", tool->name, tip.x, tip.y, tip.z);
    return count;
}
