// Oracles of another make than what they are for: every triangle in turn.
#pragma once

#include "mesh/mesh.h"

// For mesh/query.h, in long double: the height over the plane where the foot lies inside all three
// sides, else the distance from the line of a side, else from a corner.
double brute_triangle(vec3 p, const vec3 corners[3]);
double brute_distance(const struct mesh *mesh, vec3 p);

// For warp/surface_mean.h and warp/surface_integral.h: means with weights r^−power, 5 and 4, by the
// midpoint rule on triangles quartered until they are small.
struct brute_mean {
    vec3 displacement, point;
    double weight; // ∫ r^−power dA
};

struct brute_mean brute_mean(const struct mesh *mesh, const float *displacement, vec3 p);
struct brute_mean brute_integral(const struct mesh *mesh, const float *displacement, vec3 p);
