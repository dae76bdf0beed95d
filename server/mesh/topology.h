// The topology of a triangle mesh.
#pragma once

#include "mesh/mesh.h"

struct topology {
    uint32_t components;            // connected by shared vertices; unused vertices do not count
    uint32_t open_edges;            // with one triangle
    uint32_t non_manifold_edges;    // with more than two triangles
    uint32_t non_manifold_vertices; // where fans of triangles touch only in the point
    uint32_t flipped_edges;         // both triangles run along them in the same direction
    uint32_t unused_vertices;
    bool closed;   // no open edge
    bool manifold; // no non-manifold edge or vertex
    bool oriented; // no flipped edge
    int64_t euler; // vertices in use - edges + triangles
    int64_t genus; // handles of all components together; -1 where not closed, manifold, oriented
};

// mesh must pass mesh_validate. O(n log n), allocates, never fails.
struct topology topology_of(const struct mesh *mesh);
