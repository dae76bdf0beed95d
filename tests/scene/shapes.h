// Surfaces made in code, for tests and benches. Each function inits *out (the caller releases it
// with mesh_fini). Closed shapes face outwards and are centred on the origin. Millimetres.
#pragma once

#include "mesh/mesh.h"

// An octahedron with 8 n² triangles pushed onto the sphere: 4 n² + 2 vertices, no poles.
void shape_sphere(struct mesh *out, double radius, int n);

// Eight corners, twelve triangles.
void shape_box(struct mesh *out, vec3 half);

// Around z: 2 · around · across triangles.
void shape_torus(struct mesh *out, double ring_radius, double tube_radius, int around, int across);

// In the plane z = 0 facing +z, n × n squares of two triangles: open.
void shape_grid(struct mesh *out, double half, int n);

// A strip of n squares with half a twist: open, and of one side.
void shape_moebius(struct mesh *out, double radius, double half_width, int n);

// An ellipsoid with hills and hollows like a bone's: shape_sphere's triangles.
void shape_bumpy(struct mesh *out, vec3 radii, double bump_mm, int n, uint64_t seed);

// Random corners in a box, and corners nearly on a line, and corners that coincide: each triangle
// has vertices of its own.
void shape_soup(struct mesh *out, double half, int triangles, uint64_t seed);

void shape_move(struct mesh *mesh, pose T_to_from);
void shape_scale(struct mesh *mesh, double factor);
void shape_append(struct mesh *mesh, const struct mesh *other); // no vertex is shared
void shape_add_triangles(struct mesh *mesh, uint32_t count, const uint32_t *corners);

// A smooth displacement for each vertex, 3 * vertex_count, none longer than `longest_mm`. The
// caller frees it.
float *shape_displacement(const struct mesh *mesh, double longest_mm, uint64_t seed);
