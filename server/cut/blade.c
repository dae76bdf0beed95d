#include "cut/blade.h"

#include "base/check.h"

// The upper jaw of a punch turns about a hinge on the shaft's axis, from the closed lower jaw
// towards y. It takes tissue between jaw_root and jaw_length from the hinge.
static const double jaw_length = 6, jaw_root = 1, jaw_half_width = 1.75, jaw_full_deg = 35;
static const double jaw_tremor_mm = 0.5; // what goes farther between two moves bites anew
static const double burr_radius = 2;
static const vec3 knife_low = {-0.1, -1.25, -3.5},
                  knife_high = {0.1, 1.25, 0}; // its kerf is along x

// A knife that turns is swept in parts, each turning by no more than this, where there are enough.
static const double knife_part_deg = 1;

const char *blade_name(enum blade_kind kind) {
    static const char *const names[BLADE_COUNT] = {"punch", "shaver", "knife"};
    return (unsigned)kind < BLADE_COUNT ? names[kind] : "unknown";
}

double blade_reach_mm(enum blade_kind kind) {
    static const double reach[BLADE_COUNT] = {6.5, 4.5, 4};
    CHECK((unsigned)kind < BLADE_COUNT);
    return reach[kind];
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

static vec3 jaw_direction(double opening) {
    double angle = opening * jaw_full_deg * RAD_PER_DEG;
    return (vec3){0, sin(angle), cos(angle)};
}

// How far the jaw's farthest point has gone from one pose to the other.
static double jaw_way_mm(pose from, pose to) {
    double farthest = 0;
    for (int i = 0; i < 4; i++) {
        vec3 p = {i & 1 ? jaw_half_width : -jaw_half_width, 0, i & 2 ? 0 : -jaw_length};
        farthest = fmax(farthest, vec3_distance(pose_apply(from, p), pose_apply(to, p)));
    }
    return farthest;
}

// A wedge about the hinge, from the opening before to that after. A hand that trembles as it closes
// the jaw leaves no film between one move and the next: the wedge goes back to where the jaw was.
static int punch_parts(const struct blade_move *move, struct convex *out_parts, struct error *err) {
    double high = move->opening[0], low = move->opening[1];
    if (high - low < 1e-3)
        return 0;
    pose at = move->T_mesh_tip[1];
    vec3 hinge = {0, 0, -jaw_length};
    vec3 directions[3] = {jaw_direction(low), jaw_direction((low + high) / 2), jaw_direction(high)};
    struct blade_hull body = {0};
    for (int i = 0; i < 3; i++)
        for (int side = -1; side <= 1; side += 2) {
            vec3 beside = {side * jaw_half_width, 0, 0};
            vec3 from = vec3_add(hinge, beside);
            body.points[body.point_count++] =
                pose_apply(at, vec3_add_scaled(from, jaw_root, directions[i]));
            body.points[body.point_count++] =
                pose_apply(at, vec3_add_scaled(from, jaw_length, directions[i]));
        }
    bool trembled = jaw_way_mm(move->T_mesh_tip[0], at) < jaw_tremor_mm;
    for (int i = 0; i < 4 && trembled; i++) {
        vec3 from = {i & 1 ? jaw_half_width : -jaw_half_width, 0, -jaw_length};
        vec3 p = vec3_add_scaled(from, i & 2 ? jaw_root : jaw_length, directions[2]);
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

static int shaver_parts(const struct blade_move *move, struct convex *out_parts,
                        struct error *err) {
    struct blade_hull body = {.point_count = 2};
    vec3 shaft = quat_rotate(move->T_mesh_tip[1].rotation, (vec3){0, 0, 1});
    for (int i = 0; i < 2; i++)
        body.points[i] = pose_apply(move->T_mesh_tip[i], (vec3){0, 0, -burr_radius});
    vec3 way = vec3_sub(body.points[1], body.points[0]);
    add_ball(&body, vec3_length(way) < 0.02 ? shaft : vec3_unit_or(way, shaft));
    return one_part(finish(&body, burr_radius, out_parts, err));
}

// Exact for a straight move; for one that turns an outer bound.
static bool sweep_knife(pose from, pose to, struct convex *out_part, struct error *err) {
    struct blade_hull body = {0};
    for (int end = 0; end < 2; end++)
        for (int i = 0; i < 8; i++) {
            vec3 corner = {(i & 1 ? knife_high : knife_low).x, (i & 2 ? knife_high : knife_low).y,
                           (i & 4 ? knife_high : knife_low).z};
            body.points[body.point_count++] = pose_apply(end ? to : from, corner);
        }
    pose middle = pose_interpolate(from, to, 0.5);
    vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int i = 0; i < 3; i++)
        add_both(&body, quat_rotate(middle.rotation, axes[i]));
    vec3 way = vec3_sub(to.translation, from.translation);
    for (int i = 0; i < 3 && vec3_length(way) > 1e-3; i++)
        add_both(&body, vec3_cross(quat_rotate(middle.rotation, axes[i]), way));
    return finish(&body, 0, out_part, err);
}

static int knife_parts(const struct blade_move *move, struct convex *out_parts, struct error *err) {
    const pose *at = move->T_mesh_tip;
    double turn_deg = quat_angle(at[0].rotation, at[1].rotation) * DEG_PER_RAD;
    int steps = (int)fmin(CUT_PARTS_MAX, 1 + turn_deg / knife_part_deg);
    for (int i = 0; i < steps; i++)
        if (!sweep_knife(pose_interpolate(at[0], at[1], (double)i / steps),
                         pose_interpolate(at[0], at[1], (i + 1.0) / steps), &out_parts[i], err))
            return -1;
    return steps;
}

int blade_parts(const struct blade_move *move, struct convex out_parts[CUT_PARTS_MAX],
                struct error *err) {
    CHECK(pose_is_valid(move->T_mesh_tip[0]) && pose_is_valid(move->T_mesh_tip[1]));
    static int (*const parts_of[BLADE_COUNT])(const struct blade_move *, struct convex *,
                                              struct error *) = {
        [BLADE_PUNCH] = punch_parts, [BLADE_SHAVER] = shaver_parts, [BLADE_KNIFE] = knife_parts};
    CHECK((unsigned)move->kind < BLADE_COUNT);
    int count = parts_of[move->kind](move, out_parts, err);
    vec3 tip = move->T_mesh_tip[1].translation;
    if (count < 0)
        fail_in(err, RESULT_INVALID, "the %s at %.1f,%.1f,%.1f: ", blade_name(move->kind), tip.x,
                tip.y, tip.z);
    return count;
}
