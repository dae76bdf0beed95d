// A mesh as it is at one moment, in double precision, with the ids of a cut_mesh; and what it is as
// a surface, by a checker of another make than mesh/topology.h.
#pragma once

#include "cut/cut.h"

struct surface {
    uint32_t vertex_bound, triangle_bound;
    uint32_t vertex_count, triangle_count; // alive
    bool *vertex_alive;
    vec3 *vertices;
    uint32_t *triangles; // 3 for each id, MESH_NONE where it is not alive
    uint32_t *labels;
};

// The caller releases them with surface_fini.
void surface_of_cut(const struct cut_mesh *mesh, struct surface *out);
void surface_of_mesh(const struct mesh *mesh, struct surface *out); // labels 0
void surface_fini(struct surface *surface);                         // a zeroed one is fine

bool surface_equals(const struct surface *a, const struct surface *b); // every bit, every id

static inline bool surface_has(const struct surface *surface, uint32_t triangle) {
    return surface->triangles[3 * (size_t)triangle] != MESH_NONE;
}

void surface_corners(const struct surface *surface, uint32_t triangle, vec3 out_corners[3]);
double surface_volume(const struct surface *surface); // mm³

// NULL where it is closed, manifold and oriented, every living vertex in use and finite; else what
// is wrong, in words. *out_bodies: connected parts that enclose a volume of more than 0 (cavities
// do not); NULL where that is not asked for.
const char *surface_fault(const struct surface *surface, int *out_bodies);
