// Whether a point lies inside a closed mesh, the slow and sure way: the solid angles of all
// triangles (Van Oosterom and Strackee 1983) add up to 4 pi inside and to 0 outside.
#pragma once

#include "mesh/mesh.h"

static inline double solid_angle(vec3 a, vec3 b, vec3 c) {
    double la = vec3_length(a), lb = vec3_length(b), lc = vec3_length(c);
    double numerator = vec3_dot(a, vec3_cross(b, c));
    double denominator =
        la * lb * lc + vec3_dot(a, b) * lc + vec3_dot(b, c) * la + vec3_dot(c, a) * lb;
    return 2 * atan2(numerator, denominator);
}

static inline bool is_inside(const struct mesh *mesh, vec3 p) {
    double sum = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        sum +=
            solid_angle(vec3_sub(mesh_corner(mesh, t, 0), p), vec3_sub(mesh_corner(mesh, t, 1), p),
                        vec3_sub(mesh_corner(mesh, t, 2), p));
    return sum > 6.283185307179586;
}
