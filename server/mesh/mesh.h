// A triangle mesh as flat arrays: the input and output of every kernel.
#pragma once

#include "base/extremes.h"
#include "base/pose.h"
#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct mesh {
    uint32_t vertex_count;
    uint32_t triangle_count;
    float *positions;    // 3 * vertex_count: x, y, z in mm
    uint32_t *triangles; // 3 * triangle_count: vertex indices, counter-clockwise seen from outside
};

#define MESH_NONE UINT32_MAX // no triangle, no vertex

// Allocates both arrays, undefined inside. The caller releases them with mesh_fini.
void mesh_init(struct mesh *mesh, uint32_t vertex_count, uint32_t triangle_count);
void mesh_fini(struct mesh *mesh); // a zeroed mesh is fine; the mesh is zeroed
void mesh_copy(struct mesh *out_mesh, const struct mesh *mesh);

// A mesh from outside: at least one triangle, every index below vertex_count, the three corners of
// a triangle distinct, every coordinate finite and within ±10 m. The error names the first
// offender.
enum result mesh_validate(const struct mesh *mesh, struct error *err);

static inline vec3 mesh_vertex(const struct mesh *mesh, uint32_t vertex) {
    const float *p = mesh->positions + 3 * (size_t)vertex;
    return (vec3){(double)p[0], (double)p[1], (double)p[2]};
}

void mesh_set_vertex(struct mesh *mesh, uint32_t vertex, vec3 position);

// Leaves out the vertices that no triangle uses; the others keep their order.
void mesh_drop_unused(struct mesh *mesh);

// Corner 0..2 of a triangle.
static inline vec3 mesh_corner(const struct mesh *mesh, uint32_t triangle, int corner) {
    return mesh_vertex(mesh, mesh->triangles[3 * (size_t)triangle + (size_t)corner]);
}

uint32_t mesh_nearest_vertex(const struct mesh *mesh, vec3 p); // the mesh must have one

struct box {
    vec3 min, max;
};

static inline struct box box_around(struct box a, struct box b) {
    return (struct box){
        {lower(a.min.x, b.min.x), lower(a.min.y, b.min.y), lower(a.min.z, b.min.z)},
        {higher(a.max.x, b.max.x), higher(a.max.y, b.max.y), higher(a.max.z, b.max.z)}};
}

// The mesh must have a vertex.
static inline void box_include(struct box *box, vec3 p) {
    *box = box_around(*box, (struct box){p, p});
}

struct box mesh_bounds(const struct mesh *mesh);

// Signed volume enclosed (mm³) by the divergence theorem; positive where triangles face outwards.
// Has a meaning for closed, oriented meshes only.
double mesh_volume(const struct mesh *mesh);

double mesh_area(const struct mesh *mesh); // mm²
