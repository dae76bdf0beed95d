// A uniform grid of triangle ids over the box of the mesh that it was made for: which triangles lie
// near a box, and which a vertical ray may hit.
#pragma once

#include "cut/array.h"
#include "mesh/mesh.h"

struct grid {
    vec3 origin;
    double cell; // mm
    int size[3];
    uint32_t *heads; // first entry of each cell, z fastest
    struct grid_entry {
        uint32_t triangle, next;
    } * entries;
    uint32_t entry_count, entry_room, free; // free: a list of entries to use again
};

void grid_init(struct grid *grid, struct box box, double cell);
void grid_fini(struct grid *grid);
void grid_copy(struct grid *out_grid, const struct grid *grid);

// The corners must be those that it is removed with.
void grid_add(struct grid *grid, uint32_t triangle, const vec3 corners[3]);
void grid_remove(struct grid *grid, uint32_t triangle, const vec3 corners[3]);

// Appends the triangles of all cells that the box meets, each once: those that `seen` does not
// hold, which it then does.
void grid_collect(const struct grid *grid, struct box box, struct marks *seen, struct ids *out);
