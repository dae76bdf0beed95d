#include "base/check.h"
#include "landmarks/joint.h"
#include "mesh/solid.h"

#include <stdlib.h>

static const double least_gap = 0.2, least_patella_gap = 0.3; // mm
static const double sample_mm = 1, sample_deg = 2.5;          // of the femur's surface
static const double seen_deg = 50; // of the femur's surface to either side of where they meet
static const int path_rounds = 8;
static const double most_shift = 12, most_turn_deg = 10; // of one path

struct sampled {
    int count;
    struct {
        vec3 p; // femur's frame
        double angle_deg;
        int side;
    } * points;
};

// The condyles' outermost surface.
static struct sampled sample(const struct condyles *c) {
    int columns = (int)(80 / sample_mm), rows = (int)(240 / sample_deg);
    struct sampled s = {.points = alloc((size_t)columns * (size_t)rows, sizeof *s.points)};
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++) {
            double x = -40 + i * sample_mm, angle = -70 + j * sample_deg;
            double radius = profile_radius(&c->femur, x, angle);
            if (!isfinite(radius))
                continue;
            s.points[s.count].p = from_local(&c->local, profile_place(x, angle, radius));
            s.points[s.count].angle_deg = angle;
            s.points[s.count++].side = x > 0 ? COMPARTMENT_LATERAL : COMPARTMENT_MEDIAL;
        }
    return s;
}

// A place that was looked at. Another one is nearer to the solid by no more than the way between.
struct looked {
    vec3 p;
    double distance;
};

static double least_of(const struct solid *solid, pose T_femur_solid, vec3 p, double least,
                       struct looked *last, uint32_t *hint) {
    if (last->distance - vec3_distance(p, last->p) >= least)
        return least;
    last->p = p;
    last->distance = solid_distance(solid, pose_apply_inverse(T_femur_solid, p), hint);
    return fmin(least, last->distance);
}

// The least signed distance of each compartment's femur from the tibia.
static void gaps_of(const struct sampled *femur, const struct solid *tibia, pose T_femur_tibia,
                    double flexion_deg, double out_gaps[COMPARTMENT_COUNT]) {
    uint32_t hint = MESH_NONE;
    struct looked last = {.distance = -INFINITY};
    out_gaps[0] = out_gaps[1] = INFINITY;
    for (int i = 0; i < femur->count; i++) {
        if (fabs(femur->points[i].angle_deg - flexion_deg) > seen_deg)
            continue;
        double *least = &out_gaps[femur->points[i].side];
        *least = least_of(tibia, T_femur_tibia, femur->points[i].p, *least, &last, &hint);
    }
}

// Turns the tibia in varus and moves it along its axis until both gaps are there.
static pose with_gaps(const struct knee_case *knee, const struct condyles *c,
                      const struct sampled *femur, const struct solid *tibia, double flexion_deg,
                      const double wanted[COMPARTMENT_COUNT], struct path_point *out_point) {
    struct joint_angles angles = {.flexion_deg = flexion_deg};
    double width = c->ridge_x[COMPARTMENT_LATERAL] - c->ridge_x[COMPARTMENT_MEDIAL], gaps[2];
    gaps_of(femur, tibia, joint_to_pose(&knee->joint, &angles), flexion_deg,
            out_point->axes_gap_mm);
    for (int i = 0; i < path_rounds; i++) {
        gaps_of(femur, tibia, joint_to_pose(&knee->joint, &angles), flexion_deg, gaps);
        double medial = wanted[COMPARTMENT_MEDIAL] - gaps[COMPARTMENT_MEDIAL];
        double lateral = wanted[COMPARTMENT_LATERAL] - gaps[COMPARTMENT_LATERAL];
        angles.distraction_mm += (medial + lateral) / 2;
        angles.varus_deg += (lateral - medial) / width * DEG_PER_RAD;
        angles.distraction_mm = fmin(fmax(angles.distraction_mm, -most_shift), most_shift);
        angles.varus_deg = fmin(fmax(angles.varus_deg, -most_turn_deg), most_turn_deg);
    }
    pose T = joint_to_pose(&knee->joint, &angles);
    gaps_of(femur, tibia, T, flexion_deg, out_point->gap_mm);
    out_point->distraction_mm = angles.distraction_mm;
    out_point->varus_deg = angles.varus_deg;
    return T;
}

// Where a condyle has no surface about where it meets the tibia, there is no gap to keep.
static enum result look_for_condyles(const struct sampled *femur, struct error *err) {
    static const char *const names[] = {"medial", "lateral"};
    for (int k = 0; k < LANDMARKS_PATH_MAX; k++) {
        double flexion_deg = k * LANDMARKS_FLEXION_STEP;
        bool seen[COMPARTMENT_COUNT] = {false};
        for (int i = 0; i < femur->count; i++)
            seen[femur->points[i].side] |=
                fabs(femur->points[i].angle_deg - flexion_deg) <= seen_deg;
        for (int side = 0; side < COMPARTMENT_COUNT; side++)
            if (!seen[side])
                return fail(err, RESULT_INVALID,
                            "the %s condyle has no surface that meets the tibia at %g degrees of "
                            "flexion",
                            names[side], flexion_deg);
    }
    return RESULT_OK;
}

static void walk(struct knee_case *knee, const struct condyles *c, const struct sampled *femur,
                 const struct solid *tibia, struct path_fit *fit) {
    double wanted[COMPARTMENT_COUNT];
    gaps_of(femur, tibia, pose_identity(), 0, wanted);
    for (int i = 0; i < COMPARTMENT_COUNT; i++)
        wanted[i] = fmax(wanted[i], least_gap);
    knee->rest_count = 0;
    for (fit->count = 0; fit->count < LANDMARKS_PATH_MAX; fit->count++) {
        struct path_point *point = &fit->points[fit->count];
        point->flexion_deg = fit->count * LANDMARKS_FLEXION_STEP;
        point->patella_gap_mm = NAN;
        knee->rest[knee->rest_count++] =
            with_gaps(knee, c, femur, tibia, point->flexion_deg, wanted, point);
    }
}

enum result landmarks_fit_rest(struct knee_case *knee, struct path_fit *fit, struct error *err) {
    struct condyles c;
    struct solid tibia = {0};
    struct sampled femur = {0};
    enum result result = condyles_fit(&c, knee, err);
    if (result == RESULT_OK)
        result = solid_init(&tibia, &case_group(knee, "tibia")->mesh, err);
    if (result == RESULT_OK) {
        femur = sample(&c);
        result = look_for_condyles(&femur, err);
    }
    if (result == RESULT_OK)
        walk(knee, &c, &femur, &tibia, fit);
    free(femur.points);
    solid_fini(&tibia);
    condyles_fini(&c);
    return result;
}

// ---- the patella --------------------------------------------------------------------------------

struct trochlea {
    struct local local;
    vec3 axis;     // local: a point of it, it runs along x
    vec3 outwards; // local, unit: where the patella is in extension
    int count;     // of the femur's surface that the patella may meet
    vec3 *points;  // femur's frame
};

// The circle about the groove between its most anterior place and the notch.
static bool find_axis(const struct condyles *c, struct trochlea *t) {
    double y = 0, z = 0, yy = 0, yz = 0, zz = 0, q = 0, qy = 0, qz = 0;
    int count = 0;
    for (double angle = -95; angle <= -20; angle++) {
        double radius = INFINITY;
        for (double x = c->ridge_x[COMPARTMENT_MEDIAL] / 2; x < c->ridge_x[COMPARTMENT_LATERAL] / 2;
             x += 0.5)
            radius = fmin(radius, profile_radius(&c->femur, x, angle));
        vec3 p = profile_place(0, angle, radius);
        if (!vec3_is_finite(p))
            continue;
        double square = p.y * p.y + p.z * p.z;
        y += p.y, z += p.z, q += square, yy += p.y * p.y, yz += p.y * p.z, zz += p.z * p.z;
        qy += square * p.y, qz += square * p.z;
        count++;
    }
    mat3 normal = {{{yy, yz, y}, {yz, zz, z}, {y, z, count}}};
    mat3 first = {{{qy, yz, y}, {qz, zz, z}, {q, z, count}}};
    mat3 second = {{{yy, qy, y}, {yz, qz, z}, {y, q, count}}};
    double size = mat3_determinant(normal);
    t->axis = (vec3){0, mat3_determinant(first) / size / 2, mat3_determinant(second) / size / 2};
    return count > 20 && size != 0;
}

static void take_surface(const struct condyles *c, struct trochlea *t) {
    t->points = alloc(80 * 80, sizeof *t->points);
    for (int j = 0; j < 80; j++)
        for (int i = 0; i < 80; i++) {
            double x = -40 + i, angle = -140 + 2.5 * j;
            double radius = profile_radius(&c->femur, x, angle);
            if (isfinite(radius))
                t->points[t->count++] = from_local(&c->local, profile_place(x, angle, radius));
        }
}

static pose patella_at(const struct trochlea *t, double flexion_deg, double outward) {
    quat turn = quat_from_axis_angle((vec3){1, 0, 0}, -0.5 * flexion_deg * RAD_PER_DEG);
    vec3 moved = vec3_add_scaled(vec3_scale(-1, t->axis), outward, t->outwards);
    pose in_local = {turn, vec3_add(t->axis, quat_rotate(turn, moved))};
    struct local after = local_turned(&t->local, in_local);
    return pose_compose(after.T_femur_local, pose_inverse(t->local.T_femur_local));
}

static double patella_gap(const struct trochlea *t, const struct solid *patella,
                          pose T_femur_patella) {
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    struct looked last = {.distance = -INFINITY};
    for (int i = 0; i < t->count; i++)
        least = least_of(patella, T_femur_patella, t->points[i], least, &last, &hint);
    return least;
}

static void glide(struct knee_case *knee, const struct trochlea *t, const struct solid *patella,
                  struct path_fit *fit) {
    double wanted = fmax(patella_gap(t, patella, pose_identity()), least_patella_gap);
    knee->patella_key_count = 0;
    for (int k = 0; k < LANDMARKS_PATH_MAX; k++) {
        double flexion = k * LANDMARKS_FLEXION_STEP, inside = -most_shift, outside = most_shift;
        for (int i = 0; i < 14; i++) {
            double middle = (inside + outside) / 2;
            bool clear = patella_gap(t, patella, patella_at(t, flexion, middle)) >= wanted;
            *(clear ? &outside : &inside) = middle;
        }
        pose T = patella_at(t, flexion, outside);
        knee->patella_keys[knee->patella_key_count++] = (struct patella_key){flexion, T};
        fit->points[k].patella_gap_mm = patella_gap(t, patella, T);
    }
}

enum result landmarks_fit_patella(struct knee_case *knee, struct path_fit *fit, struct error *err) {
    const struct case_group *group = case_group(knee, "patella");
    struct condyles c;
    struct solid patella = {0};
    for (int i = 0; i < LANDMARKS_PATH_MAX; i++)
        fit->points[i].patella_gap_mm = NAN;
    if (!group)
        return RESULT_OK;
    enum result result = condyles_fit(&c, knee, err);
    struct trochlea t = {.local = c.local};
    if (result == RESULT_OK && !find_axis(&c, &t))
        result = fail(err, RESULT_INVALID, "no trochlea is found on the femur");
    if (result == RESULT_OK)
        result = solid_init(&patella, &group->mesh, err);
    if (result == RESULT_OK) {
        struct box box = mesh_bounds(&group->mesh);
        vec3 middle = to_local(&c.local, vec3_lerp(box.min, box.max, 0.5));
        middle.x = 0;
        t.outwards = vec3_unit_or(vec3_sub(middle, t.axis), (vec3){0, 1, 0});
        take_surface(&c, &t);
        glide(knee, &t, &patella, fit);
    }
    solid_fini(&patella);
    free(t.points);
    condyles_fini(&c);
    return result;
}
