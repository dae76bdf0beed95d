// Triangles in clusters of eight, and boxes around the clusters in a tree of eights, so that one
// call measures eight with SIMD. For query.c only.
#pragma once

#include "mesh/eights.h"
#include "mesh/mesh.h"

#define CLUSTER_SIZE EIGHT
#define CLUSTER_LEVELS_MAX 10 // 8^11 triangles

typedef float cluster_lanes[CLUSTER_SIZE];

// A triangle in a frame of its own: corner a the origin, x along its longest side to b at (b_x, 0),
// c at (c_x, c_y) with c_y >= 0, z its normal. Rounding is then relative to the distance from a,
// however thin the triangle is.
struct cluster {
    cluster_lanes a[3], x[3], y[3], z[3];
    cluster_lanes b_x, c_x, c_y;
    cluster_lanes inv_ac, inv_bc;     // 1/length², 0 where there is no length
    uint32_t triangles[CLUSTER_SIZE]; // the last one is repeated
};

struct cluster_boxes {
    cluster_lanes low[3], high[3];
};

// Box i of a level, in block i/8 of it, holds boxes 8i to 8i + 7 of the level below; those of level
// 0 hold clusters. The top level has one block.
struct cluster_tree {
    struct cluster *clusters;
    int level_count;
    uint32_t counts[CLUSTER_LEVELS_MAX]; // boxes of a level, clusters of level 0
    struct cluster_boxes *levels[CLUSTER_LEVELS_MAX];
};

void cluster_tree_init(struct cluster_tree *tree, const struct mesh *mesh);
void cluster_tree_fini(struct cluster_tree *tree);
