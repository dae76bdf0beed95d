// After a cut: slivers and vertices that shape nothing go. No vertex moves; only vertices that cuts
// made go; the surface stays where it is but for 1e-4 mm, and a sheet does not turn over.
#pragma once

#include "cut/cut_mesh.h"

struct cleaner {
    struct stamped_set touched; // vertices of triangles that the cut made
    struct stamped_set queued;  // vertices
    struct ids queue;
};

void cleaner_fini(struct cleaner *cleaner);
void clean(struct cut_mesh *mesh); // around what the cut has touched
