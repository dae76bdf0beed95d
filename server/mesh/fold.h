// Self-intersections of a surface.
#pragma once

#include "mesh/mesh.h"

struct folds {
    uint32_t crossed; // pairs of triangles of which one is pierced by an edge of the other
    uint32_t creased; // pairs with a common edge that lie on one another, the fold within a degree
};

// Triangles that only share a corner or an edge, or touch without piercing, do not count. Triangles
// without area fold nowhere. out_folded: NULL, or true for the triangles of those pairs. O(n √n)
// for surfaces of even triangles.
struct folds folds_of(const struct mesh *mesh, bool *out_folded);
