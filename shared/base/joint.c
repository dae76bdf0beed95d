#include "base/joint.h"

// On a left knee the midline lies to the right: varus, internal rotation and lateral shift mirror.
static double mirror(enum side side) {
    return side == SIDE_LEFT ? -1 : 1;
}

// The axes e1, e2, e3 in the femur's joint frame for the rotation R of the tibia.
static vec3 along_axes(mat3 r, double shift, double drawer, double distraction) {
    vec3 e1 = {1, 0, 0};
    vec3 e3 = {r.m[0][2], r.m[1][2], r.m[2][2]};
    vec3 e2 = vec3_unit_or(vec3_cross(e3, e1), (vec3){0, 1, 0});
    return vec3_add(vec3_scale(shift, e1),
                    vec3_add_scaled(vec3_scale(drawer, e2), -distraction, e3));
}

static double mix(double a, double b, double t) {
    return a + t * (b - a);
}

struct joint_angles joint_interpolate(const struct joint_angles *a, const struct joint_angles *b,
                                      double t) {
    return (struct joint_angles){
        mix(a->flexion_deg, b->flexion_deg, t),   mix(a->varus_deg, b->varus_deg, t),
        mix(a->internal_deg, b->internal_deg, t), mix(a->shift_mm, b->shift_mm, t),
        mix(a->drawer_mm, b->drawer_mm, t),       mix(a->distraction_mm, b->distraction_mm, t)};
}

pose joint_to_pose(const struct joint_frame *frame, const struct joint_angles *a) {
    double m = mirror(frame->side);
    quat q = quat_from_axis_angle((vec3){1, 0, 0}, -a->flexion_deg * RAD_PER_DEG);
    q = quat_multiply(q, quat_from_axis_angle((vec3){0, 1, 0}, m * a->varus_deg * RAD_PER_DEG));
    q = quat_multiply(q, quat_from_axis_angle((vec3){0, 0, 1}, m * a->internal_deg * RAD_PER_DEG));
    vec3 t = along_axes(quat_to_mat3(q), m * a->shift_mm, a->drawer_mm, a->distraction_mm);
    pose T_joint = {q, t};
    return pose_compose(pose_compose(frame->T_femur_joint, T_joint),
                        pose_inverse(frame->T_tibia_joint));
}

struct joint_angles joint_from_pose(const struct joint_frame *frame, pose T_femur_tibia) {
    pose T_joint = pose_compose(pose_compose(pose_inverse(frame->T_femur_joint), T_femur_tibia),
                                frame->T_tibia_joint);
    double m = mirror(frame->side);
    mat3 r = quat_to_mat3(quat_unit(T_joint.rotation));
    // R = Rx(-f) Ry(v) Rz(i): the first row is (cos v cos i, -cos v sin i, sin v).
    double cosine = hypot(r.m[0][0], r.m[0][1]);
    struct joint_angles a = {0};
    a.varus_deg = m * atan2(r.m[0][2], cosine) * DEG_PER_RAD;
    if (cosine > 1e-9) {
        a.flexion_deg = atan2(r.m[1][2], r.m[2][2]) * DEG_PER_RAD;
        a.internal_deg = m * atan2(-r.m[0][1], r.m[0][0]) * DEG_PER_RAD;
    } else {
        a.flexion_deg = atan2(-r.m[2][1], r.m[1][1]) * DEG_PER_RAD;
    }
    // t = shift e1 + drawer e2 - distraction e3 with e1 ⟂ e2 ⟂ e3, but e1 · e3 = sin v.
    vec3 t = T_joint.translation;
    vec3 e1 = {1, 0, 0}, e3 = {r.m[0][2], r.m[1][2], r.m[2][2]};
    vec3 e2 = vec3_unit_or(vec3_cross(e3, e1), (vec3){0, 1, 0});
    double s = vec3_dot(e1, e3), along1 = vec3_dot(t, e1), along3 = vec3_dot(t, e3);
    double scale = fmax(1 - s * s, 1e-18);
    a.shift_mm = m * (along1 - s * along3) / scale;
    a.drawer_mm = vec3_dot(t, e2);
    a.distraction_mm = -(along3 - s * along1) / scale;
    return a;
}

pose patella_pose(const struct patella_key *keys, int count, double flexion_deg) {
    if (count == 0)
        return pose_identity();
    if (!(flexion_deg > keys[0].flexion_deg))
        return keys[0].T_femur_patella;
    for (int i = 1; i < count; i++) {
        if (flexion_deg <= keys[i].flexion_deg) {
            double span = keys[i].flexion_deg - keys[i - 1].flexion_deg;
            return pose_interpolate(keys[i - 1].T_femur_patella, keys[i].T_femur_patella,
                                    (flexion_deg - keys[i - 1].flexion_deg) / span);
        }
    }
    return keys[count - 1].T_femur_patella;
}
