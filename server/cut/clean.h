// Cleaning after a cut: removes slivers, and vertices that do not shape the surface. It moves no
// vertex and removes only vertices made by cuts. The surface moves by at most 1e-4 mm, and no sheet
// turns over.
#pragma once

#include "cut/cut_mesh.h"

struct triangle_shape {
    vec3 normal;     // twice the area long
    double length;   // of the normal
    double thinness; // height over the longest side
    double height;   // over the longest side
};

struct cleaner {
    struct stamped_set touched; // vertices of triangles that the cut made
    struct stamped_set queued;  // vertices
    struct ids queue;
    struct stamped_set shaped; // triangles whose shape is known: its index
    struct triangle_shape *shapes;
    uint32_t shape_count, shape_room;
};

void cleaner_fini(struct cleaner *cleaner);
void clean(struct cut_mesh *mesh); // around what the cut has touched
