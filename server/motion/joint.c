#include "motion/joint.h"

static const double near_pivot = 12; // mm: what may touch when the tibia turns about the pivot
static const double near_joint = 60; // what may touch at all

// How far lateral a point of the femur lies.
static double lateral(const struct knee_case *knee, vec3 p_femur) {
    double x = pose_apply_inverse(knee->joint.T_femur_joint, p_femur).x;
    return knee->joint.side == SIDE_LEFT ? -x : x;
}

// The femur's vertex on one side (1 lateral, -1 medial) that is closest to the tibia.
static vec3 contact(const struct knee_case *knee, const struct mesh *femur,
                    const struct solid *tibia, pose T_femur_tibia, double side) {
    vec3 best = {0};
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = mesh_vertex(femur, v);
        struct closest closest;
        if (side * lateral(knee, p) <= 0 ||
            !query_closest(tibia->query, pose_apply_inverse(T_femur_tibia, p), least, hint,
                           &closest))
            continue;
        hint = closest.triangle;
        if (closest.distance < least) {
            least = closest.distance;
            best = p;
        }
    }
    return best;
}

// How far a point is from a box, 0 inside: no point of what is in it is nearer.
static double beside(const struct box *box, vec3 p) {
    vec3 d = {fmax(fmax(box->min.x - p.x, p.x - box->max.x), 0),
              fmax(fmax(box->min.y - p.y, p.y - box->max.y), 0),
              fmax(fmax(box->min.z - p.z, p.z - box->max.z), 0)};
    return vec3_length(d);
}

// The least of the femur's vertices so near a point of it from the tibia.
static double gap_near(const struct mesh *femur, const struct solid *tibia, pose T_femur_tibia,
                       vec3 middle, double radius) {
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = mesh_vertex(femur, v);
        if (vec3_distance(p, middle) >= radius)
            continue;
        p = pose_apply_inverse(T_femur_tibia, p);
        double off = beside(&tibia->box, p);
        if (off == 0 || off < least)
            least = fmin(least, solid_distance(tibia, p, &hint));
    }
    return least;
}

// Moves the tibia along its axis until the gap is there.
static pose with_gap(const struct knee_case *knee, const struct mesh *femur,
                     const struct solid *tibia, pose T, vec3 middle, double radius, double gap) {
    vec3 proximal =
        quat_rotate(quat_multiply(T.rotation, knee->joint.T_tibia_joint.rotation), (vec3){0, 0, 1});
    for (int i = 0; i < 4; i++) {
        double lack = gap - gap_near(femur, tibia, T, middle, radius);
        T.translation = vec3_add_scaled(T.translation, -lack, proximal);
    }
    return T;
}

static pose opened(const struct knee_case *knee, const struct mesh *femur,
                   const struct solid *tibia, pose T_closed, const struct joint_hold *hold) {
    struct joint_angles open = case_rest(knee, hold->flexion_deg);
    open.varus_deg -= hold->valgus_deg;
    pose T_open = joint_to_pose(&knee->joint, &open);
    vec3 pivot = contact(knee, femur, tibia, T_closed, hold->valgus_deg > 0 ? 1 : -1);
    double gap = gap_near(femur, tibia, T_closed, pivot, near_pivot);
    vec3 moved = pose_apply(T_open, pose_apply_inverse(T_closed, pivot));
    T_open.translation = vec3_add(T_open.translation, vec3_sub(pivot, moved));
    return with_gap(knee, femur, tibia, T_open, pivot, near_pivot, gap);
}

static pose glided(const struct knee_case *knee, const struct mesh *femur,
                   const struct solid *tibia, pose T_closed, pose T_open,
                   const struct joint_hold *hold) {
    vec3 centre = knee->joint.T_femur_joint.translation;
    double gap = gap_near(femur, tibia, T_closed, centre, near_joint);
    struct joint_angles angles = joint_from_pose(&knee->joint, T_open);
    angles.internal_deg += hold->internal_deg;
    angles.drawer_mm += hold->drawer_mm;
    return with_gap(knee, femur, tibia, joint_to_pose(&knee->joint, &angles), centre, near_joint,
                    gap);
}

struct joint_angles motion_joint(const struct knee_case *knee, const struct solid *femur,
                                 const struct solid *tibia, const struct joint_hold *hold) {
    struct joint_angles closed = case_rest(knee, hold->flexion_deg);
    pose T_closed = joint_to_pose(&knee->joint, &closed), T = T_closed;
    if (hold->valgus_deg != 0)
        T = opened(knee, femur->mesh, tibia, T_closed, hold);
    if (hold->internal_deg != 0 || hold->drawer_mm != 0)
        T = glided(knee, femur->mesh, tibia, T_closed, T, hold);
    else if (hold->valgus_deg == 0)
        return closed;
    return joint_from_pose(&knee->joint, T);
}

pose motion_clear(const struct knee_case *knee, const struct mesh *femur, const struct solid *group,
                  pose from, pose to) {
    vec3 centre = knee->joint.T_femur_joint.translation;
    double before = gap_near(femur, group, from, centre, near_joint);
    double after = gap_near(femur, group, to, centre, near_joint);
    return after < before ? with_gap(knee, femur, group, to, centre, near_joint, before) : to;
}
