#include "landmarks/joint.h"

#include "base/check.h"

static const int joint_rounds = 8;
static const double arc_from_deg = 20, arc_to_deg = 95; // of the posterior condyle
static const double half_ridge = 4;                     // mm of a ridge, from its middle
static const double ridge_drop = 1.5;                   // mm below the highest still is the ridge
static const double radius_least = 12, radius_most = 35;
static const double rms_most = 2.5;

void condyles_fini(struct condyles *c) {
    profile_fini(&c->femur);
}

// ---- where the condyles are ---------------------------------------------------------------------

// About where the axis runs: a radius above the distal and before the posterior end.
static vec3 first_centre(const struct local *local, const struct mesh *femur) {
    double distal = INFINITY;
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t v = 0; v < femur->vertex_count; v++)
        distal = fmin(distal, to_local(local, mesh_vertex(femur, v)).z);
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = to_local(local, mesh_vertex(femur, v));
        if (p.z > distal + 35)
            continue;
        box.min = (vec3){fmin(box.min.x, p.x), fmin(box.min.y, p.y), distal};
        box.max = (vec3){fmax(box.max.x, p.x), fmax(box.max.y, p.y), distal};
    }
    double radius = 0.27 * (box.max.x - box.min.x);
    return (vec3){(box.min.x + box.max.x) / 2, box.min.y + radius, distal + radius};
}

// The middle of the ridge of one side: of all that is nearly as far out as the farthest.
static double ridge_of(const struct profile *femur, double side) {
    double sum = 0, weights = 0;
    for (double angle = arc_from_deg; angle <= arc_to_deg; angle += 5) {
        double most = 0;
        for (double x = 6; x < 36; x += 0.5)
            most = fmax(most, profile_radius(femur, side * x, angle)); // fmax passes over NAN
        for (double x = 6; x < 36; x += 0.5) {
            double weight = profile_radius(femur, side * x, angle) - (most - ridge_drop);
            if (weight > 0 && most > radius_least && most < radius_most) {
                sum += weight * side * x;
                weights += weight;
            }
        }
    }
    return weights > 0 ? sum / weights : NAN;
}

static double ridge_radius(const struct profile *femur, double ridge_x, double angle_deg) {
    double sum = 0;
    int count = 0;
    for (double x = -half_ridge; x <= half_ridge; x += 1, count++)
        sum += profile_radius(femur, ridge_x + x, angle_deg);
    return sum / count;
}

// ---- the circle ---------------------------------------------------------------------------------

// Least Σ (|p − c|² − r²)² in the plane of y and z (Kåsa 1976).
static bool fit_circle(const vec3 *p, int count, struct condyle_fit *out_fit) {
    double y = 0, z = 0, yy = 0, yz = 0, zz = 0, q = 0, qy = 0, qz = 0;
    for (int i = 0; i < count; i++) {
        double square = p[i].y * p[i].y + p[i].z * p[i].z;
        y += p[i].y, z += p[i].z, q += square;
        yy += p[i].y * p[i].y, yz += p[i].y * p[i].z, zz += p[i].z * p[i].z;
        qy += square * p[i].y, qz += square * p[i].z;
    }
    mat3 normal = {{{yy, yz, y}, {yz, zz, z}, {y, z, count}}};
    mat3 first = {{{qy, yz, y}, {qz, zz, z}, {q, z, count}}};
    mat3 second = {{{yy, qy, y}, {yz, qz, z}, {y, q, count}}};
    double size = mat3_determinant(normal);
    if (count < 8 || size == 0)
        return false;
    vec3 c = {0, mat3_determinant(first) / size / 2, mat3_determinant(second) / size / 2};
    double radius = 0, squares = 0;
    for (int i = 0; i < count; i++)
        radius += hypot(p[i].y - c.y, p[i].z - c.z) / count;
    for (int i = 0; i < count; i++) {
        double off = hypot(p[i].y - c.y, p[i].z - c.z) - radius;
        squares += off * off;
    }
    *out_fit = (struct condyle_fit){c, radius, sqrt(squares / count)};
    return true;
}

static bool fit_side(struct condyles *c, int side) {
    vec3 points[128];
    int count = 0;
    double x = ridge_of(&c->femur, side == COMPARTMENT_LATERAL ? 1 : -1);
    if (!isfinite(x))
        return false;
    for (double angle = arc_from_deg; angle <= arc_to_deg; angle++) {
        double radius = ridge_radius(&c->femur, x, angle);
        if (radius > radius_least && radius < radius_most)
            points[count++] = profile_place(x, angle, radius);
    }
    c->ridge_x[side] = x;
    struct condyle_fit *fit = &c->fits[side];
    if (!fit_circle(points, count, fit))
        return false;
    fit->centre.x = x;
    return fit->radius_mm > radius_least && fit->radius_mm < radius_most;
}

// ---- the frame ----------------------------------------------------------------------------------

// The x axis through both centres, the z axis as near as that lets to where it was.
static pose frame_of(const struct condyles *c) {
    vec3 medial = c->fits[COMPARTMENT_MEDIAL].centre, lateral = c->fits[COMPARTMENT_LATERAL].centre;
    vec3 x = vec3_unit_or(vec3_sub(lateral, medial), (vec3){1, 0, 0});
    vec3 y = vec3_unit_or(vec3_cross((vec3){0, 0, 1}, x), (vec3){0, 1, 0}), z = vec3_cross(x, y);
    mat3 r = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    return (pose){quat_from_mat3(r), vec3_lerp(medial, lateral, 0.5)};
}

static bool look_again(struct condyles *c, const struct mesh *femur) {
    profile_fini(&c->femur);
    profile_unroll(&c->femur, &c->local, femur);
    return fit_side(c, COMPARTMENT_MEDIAL) && fit_side(c, COMPARTMENT_LATERAL);
}

enum result condyles_fit(struct condyles *c, struct knee_case *knee, struct error *err) {
    const struct mesh *femur = &case_group(knee, "femur")->mesh;
    *c = (struct condyles){.local = local_of(knee)};
    pose first = {quat_identity(), first_centre(&c->local, femur)};
    c->local = local_turned(&c->local, first);
    bool found = true;
    for (int i = 0; i < joint_rounds && found; i++) {
        found = look_again(c, femur);
        if (found)
            c->local = local_turned(&c->local, frame_of(c));
    }
    found = found && look_again(c, femur);
    for (int i = 0; i < COMPARTMENT_COUNT && found; i++)
        found = c->fits[i].rms_mm < rms_most;
    if (found)
        return RESULT_OK;
    return fail(
        err, RESULT_INVALID,
        "no two posterior condyles are found on the femur: the joint's axes point wrong, or "
        "the femur is not whole behind");
}

enum result landmarks_fit_joint(struct knee_case *knee, struct joint_fit *out_fit,
                                struct error *err) {
    struct condyles c;
    enum result result = condyles_fit(&c, knee, err);
    *out_fit = (struct joint_fit){.T_femur_joint = local_joint(&c.local)};
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        out_fit->condyles[i] = c.fits[i];
        out_fit->condyles[i].centre = from_local(&c.local, c.fits[i].centre);
    }
    pose before = knee->joint.T_femur_joint, after = out_fit->T_femur_joint;
    out_fit->turned_deg = quat_angle(before.rotation, after.rotation) * DEG_PER_RAD;
    out_fit->moved_mm = vec3_distance(before.translation, after.translation);
    condyles_fini(&c);
    return result;
}
