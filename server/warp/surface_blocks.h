// A tree of balls around the triangles of a static mesh, eight children to a block, laid out for
// SIMD lanes; and the moments of a displacement over them. What warp/surface_integral.h walks.
// Millimetres, in the mesh's frame.
#pragma once

#include "warp/surface_tree.h"

#define BLOCK_LANES 8

typedef double block_lanes[BLOCK_LANES]; // one number of each lane
#define BLOCK_ALIGN sizeof(block_lanes)

// Up to eight pieces of surface; lanes from `count` on have no area.
struct surface_block {
    _Alignas(BLOCK_ALIGN) block_lanes centre[3];
    block_lanes area, square;    // square: of the radius of a ball that holds the piece
    block_lanes spread[6];       // ∫ s sᵀ dA: xx, xy, xz, yy, yz, zz
    uint32_t child[BLOCK_LANES]; // a block, or a triangle where the block is at the bottom
    uint32_t parent;             // the root is its own
    uint32_t count;
    bool is_bottom;
};

// In preorder, the root first.
struct surface_blocks {
    const struct mesh *mesh;
    uint32_t count;
    struct surface_block *blocks;
    uint32_t *bottom_of; // each corner of each triangle, sorted by vertex: the triangle's block
    uint32_t *first_of;  // vertex_count + 1: where each vertex begins in bottom_of
};

// Keeps a pointer to the mesh, which must have a triangle and outlive the blocks unchanged. Reading
// them is safe from any number of threads.
struct surface_blocks *surface_blocks_create(const struct mesh *mesh);
void surface_blocks_destroy(struct surface_blocks **blocks); // NULL inside is fine

// A displacement over the pieces of one block.
struct block_moments {
    _Alignas(BLOCK_ALIGN) block_lanes mean[3]; // ∫ u dA / A
    block_lanes slope[9];                      // ∫ u sᵀ dA, row by row
    bool moves;                                // not 0 all over
};

// A triangle and what moves its corners; it need not be one of the mesh.
struct surface_patch {
    vec3 x[3], u[3];
};

// displacement: 3 * vertex_count of the mesh, NULL for 0.
struct surface_patch surface_patch_of(const struct mesh *mesh, const float *displacement,
                                      uint32_t triangle);

// A patch as one lane of a block; moments may be NULL.
void surface_patch_fill(const struct surface_patch *patch, int lane, struct surface_block *block,
                        struct block_moments *moments);

// The moments of block `index`, those of the blocks below it being known.
void surface_block_gather(const struct surface_blocks *blocks, const float *displacement,
                          struct block_moments *all, uint32_t index);
