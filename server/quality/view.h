// Seen from above: the frame in which a meniscus is a C. Millimetres.
#pragma once

#include "mesh/mesh.h"

struct plan_view {
    mat3 axes;   // rows: anterior, up × anterior, up
    vec3 origin; // in the mesh's frame
};

static inline vec3 view_point(const struct plan_view *view, vec3 p) {
    return mat3_apply(view->axes, vec3_sub(p, view->origin));
}

static inline void view_corners(const struct plan_view *view, const struct mesh *mesh,
                                uint32_t triangle, vec3 out_corners[3]) {
    for (int i = 0; i < 3; i++)
        out_corners[i] = view_point(view, mesh_corner(mesh, triangle, i));
}
