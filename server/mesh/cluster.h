// Triangles in clusters, so that one call measures many with SIMD. For query.c only.
#pragma once

#include "mesh/mesh.h"

#define CLUSTER_SIZE 8
#define LANES 4

typedef float lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef int32_t lane_mask __attribute__((vector_size(LANES * sizeof(int32_t))));

#define CLUSTER_BLOCKS (CLUSTER_SIZE / LANES)

// A triangle in a frame of its own: corner a the origin, x along its longest side to b at (b_x, 0),
// c at (c_x, c_y) with c_y >= 0, z its normal. Rounding is then relative to the distance from a,
// however thin the triangle is.
struct cluster_block {
    lanes a[3], x[3], y[3], z[3];
    lanes b_x, c_x, c_y;
    lanes inv_ac, inv_bc; // 1/length², 0 where there is no length
};

struct cluster {
    struct cluster_block blocks[CLUSTER_BLOCKS];
    uint32_t triangles[CLUSTER_SIZE]; // the last one is repeated
    float low[3], high[3];            // box
};

// Clusters of triangles that lie together, at most CLUSTER_SIZE each. The caller frees the array.
struct cluster *clusters_create(const struct mesh *mesh, uint32_t *out_count);

// Square distances from p to all triangles of a cluster. Their roots are off from the true
// distances by a few roundings of |p − a| (at most 8 FLT_EPSILON (|p| + |a|)). Same bits on every
// CPU.
void cluster_distances(const struct cluster *cluster, const float p[3],
                       float out_squares[CLUSTER_SIZE]);
