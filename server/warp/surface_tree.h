// Balls around the triangles of a static mesh, one inside the other, with the moments of the area
// in them: what warp/surface_mean.h walks. Millimetres, in the mesh's frame.
#pragma once

#include "mesh/mesh.h"

#define SURFACE_LEAF_MAX 4 // triangles; at least 2, the children of an inner node

// A piece of the surface, up to the second moments of its area about its centre.
struct surface_piece {
    vec3 centre;   // of the area
    double area;   // mm²
    double radius; // of a ball around the centre that holds the piece
    mat3 spread;   // ∫ s sᵀ dA, s = x − centre
};

struct surface_node {
    struct surface_piece piece;
    uint32_t end;          // the node after its last descendant
    uint32_t first, count; // its triangles in `order`
};

// In preorder: the children of an inner node i are i + 1 and nodes[i + 1].end.
struct surface_tree {
    const struct mesh *mesh;
    uint32_t node_count;
    struct surface_node *nodes;
    uint32_t *parents;  // the root is its own
    uint32_t *order;    // triangles
    uint32_t *leaf_of;  // each corner of each triangle, sorted by vertex: the leaf of the triangle
    uint32_t *first_of; // vertex_count + 1: where each vertex begins in leaf_of
};

// Keeps a pointer to the mesh, which must have a triangle and outlive the tree unchanged. Reading a
// tree is safe from any number of threads.
struct surface_tree *surface_tree_create(const struct mesh *mesh);
void surface_tree_destroy(struct surface_tree **tree); // NULL inside is fine

static inline bool surface_is_leaf(const struct surface_tree *tree, uint32_t node) {
    return tree->nodes[node].end == node + 1;
}

struct surface_piece surface_triangle(const vec3 corners[3]);

// The triangles of a leaf or the two children of an inner node; returns how many.
int surface_pieces(const struct surface_tree *tree, uint32_t node,
                   struct surface_piece out_pieces[SURFACE_LEAF_MAX]);

// a bᵀ added to *sum, scaled.
static inline void surface_add_outer(mat3 *sum, double scale, vec3 a, vec3 b) {
    const double x[3] = {scale * a.x, scale * a.y, scale * a.z};
    for (int i = 0; i < 3; i++) {
        sum->m[i][0] += x[i] * b.x;
        sum->m[i][1] += x[i] * b.y;
        sum->m[i][2] += x[i] * b.z;
    }
}
