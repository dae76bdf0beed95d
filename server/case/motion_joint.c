#include "case/motion_joint.h"

static const double near_pivot = 12; // mm: what may touch when the tibia turns about the pivot

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

static double gap_near(const struct mesh *femur, const struct solid *tibia, pose T_femur_tibia,
                       vec3 pivot) {
    double least = INFINITY;
    uint32_t hint = MESH_NONE;
    for (uint32_t v = 0; v < femur->vertex_count; v++) {
        vec3 p = mesh_vertex(femur, v);
        if (vec3_distance(p, pivot) < near_pivot)
            least = fmin(least, solid_distance(tibia, pose_apply_inverse(T_femur_tibia, p), &hint));
    }
    return least;
}

struct joint_angles motion_joint(const struct knee_case *knee, const struct solid *femur,
                                 const struct solid *tibia, double flexion_deg, double valgus_deg) {
    const struct joint_frame *frame = &knee->joint;
    struct joint_angles closed = {.flexion_deg = flexion_deg};
    struct joint_angles open = {.flexion_deg = flexion_deg, .varus_deg = -valgus_deg};
    if (valgus_deg == 0)
        return closed;
    pose T_closed = joint_to_pose(frame, &closed), T_open = joint_to_pose(frame, &open);
    vec3 pivot = contact(knee, femur->mesh, tibia, T_closed, valgus_deg > 0 ? 1 : -1);
    double gap = gap_near(femur->mesh, tibia, T_closed, pivot);
    vec3 moved = pose_apply(T_open, pose_apply_inverse(T_closed, pivot));
    T_open.translation = vec3_add(T_open.translation, vec3_sub(pivot, moved));
    vec3 proximal =
        quat_rotate(quat_multiply(T_open.rotation, frame->T_tibia_joint.rotation), (vec3){0, 0, 1});
    for (int i = 0; i < 4; i++) {
        double lack = gap - gap_near(femur->mesh, tibia, T_open, pivot);
        T_open.translation = vec3_add_scaled(T_open.translation, -lack, proximal);
    }
    return joint_from_pose(frame, T_open);
}
