// A convex polyhedron with few faces: what blades and planned resections are unions of.
// Millimetres. No allocation.
#pragma once

#include "mesh/mesh.h"

#define CONVEX_PLANES_MAX 64
#define CONVEX_VERTICES_MAX 124 // 2 f - 4
#define CONVEX_EDGES_MAX 186    // 3 f - 6

struct plane {
    vec3 normal;   // unit length, outwards
    double offset; // inside where dot(normal, p) <= offset
};

// An edge from ends[0] to ends[1]: seen from outside face left lies to its left, right to its
// right.
struct convex_edge {
    uint8_t ends[2];
    uint8_t left, right;
};

struct convex {
    int plane_count, vertex_count, edge_count;
    struct plane planes[CONVEX_PLANES_MAX]; // each one a face
    vec3 vertices[CONVEX_VERTICES_MAX];
    struct convex_edge edges[CONVEX_EDGES_MAX];
    // The corners of face i, counter-clockwise seen from outside, are
    // corners[first_corner[i]] to corners[first_corner[i + 1] - 1].
    uint16_t first_corner[CONVEX_PLANES_MAX + 1];
    uint8_t corners[2 * CONVEX_EDGES_MAX];
    double volume; // mm³
    struct box box;
};

// The polyhedron that the half-spaces have in common. Normals need not have unit length; planes
// that do not bound it are left out, and those that are kept make an equal one. RESULT_INVALID, the
// error saying which: too few or too many planes, a number that is not finite, a normal without
// length, nothing in common (or less than 1e-6 mm³), no bound within 100 m (planes that look
// inwards).
enum result convex_create(const struct plane *planes, int count, struct convex *out_convex,
                          struct error *err);

// The half-spaces with these normals (unit length) that just hold all points: an outer bound of
// their hull, the hull itself where the normals are those of its faces.
void convex_supports(const vec3 *points, int point_count, const vec3 *normals, int normal_count,
                     struct plane *out_planes);

bool convex_contains(const struct convex *convex, vec3 p); // its surface counts as inside
