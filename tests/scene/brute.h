// An oracle of another make than mesh/query.h: long double, every triangle in turn; the height over
// the plane where the foot lies inside all three sides, else the distance from the line of a side,
// else from a corner.
#pragma once

#include "mesh/mesh.h"

double brute_triangle(vec3 p, const vec3 corners[3]);
double brute_distance(const struct mesh *mesh, vec3 p);
