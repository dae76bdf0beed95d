#include "landmarks/local.h"

#include "base/check.h"

static vec3 mirrored(vec3 p) {
    return (vec3){-p.x, p.y, p.z};
}

static pose pose_mirrored(pose p) {
    quat q = p.rotation;
    return (pose){{q.w, q.x, -q.y, -q.z}, mirrored(p.translation)};
}

struct local local_of(const struct knee_case *knee) {
    return (struct local){knee->joint.T_femur_joint, knee->joint.side == SIDE_LEFT};
}

vec3 to_local(const struct local *local, vec3 p) {
    p = pose_apply_inverse(local->T_femur_local, p);
    return local->is_mirrored ? mirrored(p) : p;
}

vec3 from_local(const struct local *local, vec3 p) {
    return pose_apply(local->T_femur_local, local->is_mirrored ? mirrored(p) : p);
}

struct local local_turned(const struct local *local, pose T_local_new) {
    pose T = local->is_mirrored ? pose_mirrored(T_local_new) : T_local_new;
    return (struct local){pose_compose(local->T_femur_local, T), local->is_mirrored};
}

pose local_joint(const struct local *local) {
    pose T = local->T_femur_local;
    return (pose){quat_unit(T.rotation), T.translation};
}

vec3 *local_points(const struct local *local, const struct mesh *mesh) {
    vec3 *points = alloc(mesh->vertex_count, sizeof *points);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        points[v] = to_local(local, mesh_vertex(mesh, v));
    return points;
}
