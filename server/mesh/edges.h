// Edges of a triangle mesh as sorted sides of its triangles, and disjoint sets: for kernels that
// need to know how triangles connect.
#pragma once

#include "mesh/mesh.h"

// One side of a triangle. Sorted by its two ends, then by triangle, the sides of one edge lie
// together.
struct triangle_side {
    uint32_t low, high;
    uint32_t triangle;
    bool forward; // the triangle runs from low to high
};

// All 3 * triangle_count sides, sorted. The caller frees the array.
struct triangle_side *edges_sorted(const struct mesh *mesh);

// The end of the sides that share an edge with the one at `start`.
size_t edges_end(const struct triangle_side *sides, size_t start, size_t count);

// Of each vertex whether it is an end of an edge that only one triangle has. The caller frees it.
bool *edges_open_vertices(const struct mesh *mesh);

// Disjoint sets: each of 0 .. count - 1 alone. The caller frees the array.
uint32_t *sets_create(uint32_t count);
uint32_t sets_find(uint32_t *sets, uint32_t i); // the one that stands for i's set
void sets_join(uint32_t *sets, uint32_t a, uint32_t b);

// Two triangles meet at an edge: in `fans`, sets of the 3 * triangle_count corners, their corners
// at both of its ends become one fan.
void edges_join_fans(const struct mesh *mesh, uint32_t *fans, const struct triangle_side *a,
                     const struct triangle_side *b);
