// What a cut says that it did, held against the mesh before and after it.
#pragma once

#include "cutting/surface.h"

struct cut_tried {
    const struct snapshot *before, *after;
    double volume_before; // mm³
    uint32_t original;    // vertices of the mesh that the cut_mesh was made from
    const struct convex *parts;
    int part_count;
};

// NULL where all of it holds; else what does not, in words:
//   ids       freed, made and vertices are ascending and exactly what differs between both meshes
//   vertices  none was moved; no id of the original mesh was given to another vertex
//   surface   closed, manifold, oriented; one body; pieces too, none larger than what stayed
//   volumes   before = after + removed + pieces, removed no more than the parts hold
//   place     away from the parts' box what is new lies on the surface that was there
//   labels    of surface that was there as before; patches have the area of the new surface
const char *change_fault(const struct cut_tried *tried, const struct cut_mesh *mesh,
                         const struct cut_change *change);
