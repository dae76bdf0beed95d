// Normals that make a triangle mesh look smooth where it is, and keep its edges where it has some.
#pragma once

#include "mesh/mesh.h"

// A unit normal for each corner, 3 * triangle_count: the mean, weighted by area, of the triangles
// about the vertex that face within `crease_deg` of the corner's own. The caller frees the array.
vec3 *corner_normals(const struct mesh *mesh, double crease_deg);
