#include "scene/torn.h"

#include "base/check.h"

#include <stdio.h>

struct joint_frame torn_joint(struct random *r) {
    enum side side = random_bits(r) & 1 ? SIDE_LEFT : SIDE_RIGHT;
    pose T_femur_joint = random_pose(r, 40);
    return (struct joint_frame){side, T_femur_joint, random_pose(r, 40)};
}

void torn_start(struct torn *knee, struct joint_frame joint) {
    *knee = (struct torn){.setup = {.joint = joint, .keys = knee->keys, .rest = knee->rest}};
}

void torn_add(struct torn *knee, int ligament, struct joint_angles physical,
              struct joint_angles target) {
    knee->keys[knee->setup.key_count++] =
        (struct adaptive_key){ligament, torn_pose(knee, physical), torn_pose(knee, target)};
}

void torn_add_valgus(struct torn *knee, double flexion, double extra_deg) {
    struct joint_angles a = {.flexion_deg = flexion, .varus_deg = -6}, b = a;
    b.varus_deg -= extra_deg;
    torn_add(knee, MCL, a, b);
}

void torn_add_drawer(struct torn *knee, double flexion, double extra_mm) {
    struct joint_angles a = {.flexion_deg = flexion, .drawer_mm = 6}, b = a;
    b.drawer_mm += extra_mm;
    torn_add(knee, ACL, a, b);
}

static double about(struct random *r, double value, double spread) {
    return value + random_between(r, -spread, spread);
}

void torn_add_recorded(struct torn *knee, struct random *r, int ligament, double flexion) {
    static const struct joint_angles ends[] = {
        {.varus_deg = -6}, {.drawer_mm = 6}, {.varus_deg = 6}, {.internal_deg = -15}};
    struct joint_angles physical = ends[ligament];
    physical.flexion_deg = flexion;
    physical.varus_deg = about(r, physical.varus_deg, 1);
    physical.internal_deg = about(r, physical.internal_deg, 3);
    physical.shift_mm = about(r, 0, 1);
    physical.drawer_mm = about(r, physical.drawer_mm, 1);
    physical.distraction_mm = about(r, 0, 1);
    struct joint_angles target = physical;
    target.flexion_deg = about(r, flexion, 3);
    target.varus_deg = about(r, 2.5 * physical.varus_deg, 3);
    target.internal_deg = about(r, 1.5 * physical.internal_deg, 3);
    target.drawer_mm = about(r, 2 * physical.drawer_mm, 3);
    target.distraction_mm = about(r, 2, 1);
    torn_add(knee, ligament, physical, target);
}

void torn_add_rest_path(struct torn *knee, int count) {
    for (int i = 0; i < count; i++) {
        double flexion = 120.0 * i / (count - 1);
        knee->rest[knee->setup.rest_count++] =
            torn_pose(knee, (struct joint_angles){.flexion_deg = flexion,
                                                  .varus_deg = 0.02 * flexion,
                                                  .internal_deg = 15 * (1 - exp(-flexion / 30)),
                                                  .drawer_mm = -0.05 * flexion,
                                                  .distraction_mm = 0.5 * sin(flexion / 40)});
    }
}

void torn_build(struct torn *knee, enum adaptive_kind kind) {
    struct error error = {""};
    knee->setup.kind = kind;
    if (adaptive_create(&knee->setup, &knee->adaptive, &error) != RESULT_OK) {
        fputs(error.text, stderr);
        CHECK(knee->adaptive);
    }
}

void torn_destroy(struct torn *knee) {
    adaptive_destroy(&knee->adaptive);
}

void torn_create(struct torn *knee, struct random *r, bool mcl, bool acl) {
    torn_start(knee, torn_joint(r));
    for (int i = 0; i < 3 && mcl; i++)
        torn_add_valgus(knee, (const double[]){15, 45, 65}[i], 10);
    for (int i = 0; i < 2 && acl; i++)
        torn_add_drawer(knee, (const double[]){20, 70}[i], 5);
    torn_build(knee, ADAPTIVE_HINGE);
}

pose torn_pose(const struct torn *knee, struct joint_angles angles) {
    return joint_to_pose(&knee->setup.joint, &angles);
}

pose torn_seen(const struct torn *knee, pose T_femur_tibia) {
    struct adaptive_warp warp;
    adaptive_at(knee->adaptive, ADAPTIVE_RAMP_STRAIGHT, T_femur_tibia, &warp);
    return pose_compose(warp.correction, T_femur_tibia);
}

double torn_apart(const struct torn *knee, pose a, pose b) {
    double most = 0;
    for (int i = 0; i < 8; i++) {
        vec3 corner = {i & 1 ? 40 : -40, i & 2 ? 40 : -40, i & 4 ? 40 : -40};
        vec3 p = pose_apply(knee->setup.joint.T_tibia_joint, corner);
        most = fmax(most, vec3_distance(pose_apply(a, p), pose_apply(b, p)));
    }
    return most;
}

struct joint_angles torn_extra(const struct torn *knee, struct joint_angles angles) {
    pose A = torn_seen(knee, torn_pose(knee, angles));
    struct joint_angles a = joint_from_pose(&knee->setup.joint, A);
    a.flexion_deg -= angles.flexion_deg;
    a.varus_deg -= angles.varus_deg;
    a.internal_deg -= angles.internal_deg;
    a.shift_mm -= angles.shift_mm;
    a.drawer_mm -= angles.drawer_mm;
    a.distraction_mm -= angles.distraction_mm;
    return a;
}

double torn_extra_valgus(const struct torn *knee, double flexion, double valgus) {
    struct joint_angles angles = {.flexion_deg = flexion, .varus_deg = -valgus};
    return -torn_extra(knee, angles).varus_deg;
}
