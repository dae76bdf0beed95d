// A mesh as it is at one moment, in double precision, with the ids of a cut_mesh; and what it is as
// a surface, by a checker of another make than mesh/topology.h.
#pragma once

#include "cut/cut.h"

struct snapshot {
    uint32_t vertex_bound, triangle_bound;
    uint32_t vertex_count, triangle_count; // alive
    bool *vertex_alive;
    vec3 *vertices;
    uint32_t *triangles; // 3 for each id, MESH_NONE where it is not alive
    uint32_t *labels;
};

// The caller releases them with snapshot_fini.
void snapshot_of_cut(const struct cut_mesh *mesh, struct snapshot *out);
void snapshot_of_mesh(const struct mesh *mesh, struct snapshot *out); // labels 0
void snapshot_fini(struct snapshot *surface);                         // a zeroed one is fine

bool snapshot_equals(const struct snapshot *a, const struct snapshot *b); // every bit, every id

static inline bool snapshot_has(const struct snapshot *surface, uint32_t triangle) {
    return surface->triangles[3 * (size_t)triangle] != MESH_NONE;
}

void snapshot_corners(const struct snapshot *surface, uint32_t triangle, vec3 out_corners[3]);
double snapshot_volume(const struct snapshot *surface); // mm³

// NULL where it is closed, manifold and oriented, every living vertex in use and finite; else what
// is wrong, in words. *out_bodies: connected parts that enclose a volume of more than 0 (cavities
// do not); NULL where that is not asked for.
const char *snapshot_fault(const struct snapshot *surface, int *out_bodies);
