// Triangles in clusters, so that one call measures many with SIMD. For query.c only.
#pragma once

#include "mesh/mesh.h"

#define CLUSTER_SIZE 8
#define LANES 4

typedef float lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef int32_t lane_mask __attribute__((vector_size(LANES * sizeof(int32_t))));

#define CLUSTER_BLOCKS (CLUSTER_SIZE / LANES)

// Corner a, sides ab and ac, unit normal, and what the closest points of plane and edges need.
struct cluster_block {
    lanes a[3], ab[3], ac[3], normal[3];
    lanes s_ab, s_ac, t_ac; // barycentric s = s_ab ab·ap − s_ac ac·ap, t = t_ac ac·ap − s_ac ab·ap
    lanes slack;            // how far s and t may be off by rounding
    lanes inv_ab, inv_ac, inv_bc; // 1/length², 0 where there is no length
    lanes bc_offset;              // ab·ab − ab·ac
};

struct cluster {
    struct cluster_block blocks[CLUSTER_BLOCKS];
    uint32_t triangles[CLUSTER_SIZE]; // the last one is repeated
    float low[3], high[3];            // box
};

// Clusters of triangles that lie together, at most CLUSTER_SIZE each. The caller frees the array.
struct cluster *clusters_create(const struct mesh *mesh, uint32_t *out_count);

// Square distances from p to all triangles of a cluster; by rounding alone off from the true ones,
// and for thin triangles never above them by more. Same bits on every CPU.
void cluster_distances(const struct cluster *cluster, const float p[3],
                       float out_squares[CLUSTER_SIZE]);
