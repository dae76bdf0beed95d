// After a cut: slivers and vertices that shape nothing go. No vertex moves; only vertices that cuts
// made go; the surface stays where it is but for 1e-4 mm, and a sheet does not turn over.
#pragma once

#include "cut/tissue.h"

struct cleaner {
    struct marks touched; // vertices of triangles that the cut made
    struct marks queued;  // vertices
    struct ids queue;
};

void cleaner_fini(struct cleaner *cleaner);
void clean(struct cut_mesh *mesh); // around what the cut has touched
