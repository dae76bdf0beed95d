// A knee that was moved, turned or mirrored as a whole, for tests of what must go with it.
#pragma once

#include "case/case.h"

static inline vec3 moved_point(vec3 p, pose T, bool mirror) {
    return pose_apply(T, mirror ? (vec3){-p.x, p.y, p.z} : p);
}

static inline pose moved_frame(pose frame, pose T, bool mirror) {
    quat q = frame.rotation;
    if (mirror)
        frame = (pose){{q.w, q.x, -q.y, -q.z},
                       {-frame.translation.x, frame.translation.y, frame.translation.z}};
    return pose_compose(T, frame);
}

// Moves surfaces and joint frame, mirrored in x first where that is asked for.
static inline void move_knee(struct knee_case *knee, pose T, bool mirror) {
    for (int g = 0; g < knee->group_count; g++) {
        struct mesh *mesh = &knee->groups[g].mesh;
        for (uint32_t v = 0; v < mesh->vertex_count; v++)
            mesh_set_vertex(mesh, v, moved_point(mesh_vertex(mesh, v), T, mirror));
        for (size_t t = 0; mirror && t < mesh->triangle_count; t++) {
            uint32_t *corner = mesh->triangles + 3 * t, first = corner[0];
            corner[0] = corner[1];
            corner[1] = first;
        }
    }
    knee->joint.T_femur_joint = moved_frame(knee->joint.T_femur_joint, T, mirror);
    knee->joint.T_tibia_joint = moved_frame(knee->joint.T_tibia_joint, T, mirror);
    if (mirror)
        knee->joint.side = knee->joint.side == SIDE_LEFT ? SIDE_RIGHT : SIDE_LEFT;
}
