// Cuts off what lies far from the joint: a whole bone becomes its end.
#pragma once

#include "base/result.h"
#include "mesh/mesh.h"

struct clip_report {
    uint32_t removed_triangles;
    int planes; // cut: 0, 1 or 2
    bool open;  // an open surface was cut along its triangles, without a cap
};

// Removes what lies more than `distance_mm` above or below the origin (z). Closed, manifold meshes
// are cut there and closed with caps; of others, triangles that reach beyond are left out. A mesh
// that reaches nowhere beyond stays to the bit. Refused: a mesh of which nothing is left.
enum result import_clip(struct mesh *mesh, double distance_mm, struct clip_report *out_report,
                        struct error *err);
