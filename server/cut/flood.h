// Finds the connected bodies that a cut left. Floods start at the triangles that the cut touched
// and advance in step, so the cost grows with the smaller bodies only.
#pragma once

#include "cut/hollow.h"

struct triangle_list {
    uint32_t first, last; // of entries; MESH_NONE: none
};

struct flood_body {
    uint32_t parent; // the body that it has become part of; itself where it has not
    bool whole;      // all its triangles are known
    uint32_t count;
    struct triangle_list done, waiting;
};

struct flood {
    struct stamped_set owner; // of a triangle: a body
    struct flood_entry {
        uint32_t triangle, next;
    } * entries;
    struct flood_body *bodies;
    uint32_t entry_count, entry_room, body_count, body_room;
    struct cavities cavities; // of the mesh, where there may be any
    struct ids list;          // scratch
};

void flood_fini(struct flood *flood);

// Finds the bodies: those that are their own parent. All are whole, except at most one. Returns how
// many.
uint32_t flood_run(const struct cut_mesh *mesh, struct flood *flood);
void flood_finish(const struct cut_mesh *mesh, struct flood *flood,
                  uint32_t body); // makes it whole
