// Cuts off what lies far from the joint: a whole bone becomes its end.
#pragma once

#include "base/result.h"
#include "mesh/mesh.h"

struct clip_report {
    uint32_t far_triangles; // that reached beyond
    int plane_count;
    struct clip_plane {
        double z;         // mm of the case
        bool capped;      // else it was cut along its triangles
        struct error why; // where it was not
        struct box cap;   // where it was
    } planes[2];
};

// Removes what lies more than `distance_mm` above or below the origin (z). Closed, manifold meshes
// are cut there and closed with caps; of others, triangles that reach beyond are left out, with
// their vertices. A mesh that reaches nowhere beyond stays to the bit. Refused: a mesh of which
// nothing is left.
enum result import_clip(struct mesh *mesh, double distance_mm, struct clip_report *out_report,
                        struct error *err);
