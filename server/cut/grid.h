// A uniform grid of triangle ids over the box of the mesh that it was made for: it finds the
// triangles near a box, and those that a vertical ray may hit.
#pragma once

#include "cut/stamped_set.h"
#include "mesh/convex.h"

struct triangle_grid {
    vec3 origin;
    double cell;   // mm
    double per_mm; // cells
    int size[3];
    uint32_t *heads; // first entry of each cell, z fastest
    struct grid_entry {
        uint32_t triangle, next;
    } * entries;
    uint32_t entry_count, entry_room, free; // free: a list of entries to use again
};

void grid_init(struct triangle_grid *grid, struct box box, double cell);
void grid_fini(struct triangle_grid *grid);
void grid_clear(struct triangle_grid *grid); // no triangle is in it
void grid_copy(struct triangle_grid *out_grid, const struct triangle_grid *grid);

// Remove a triangle with the same corners with which it was added.
void grid_add(struct triangle_grid *grid, uint32_t triangle, const vec3 corners[3]);
void grid_remove(struct triangle_grid *grid, uint32_t triangle, const vec3 corners[3]);

// Appends the triangles of the cells that the box meets, each once: those that `seen` does not
// hold, which it then does. Cells that lie outside one of the planes are left out.
void grid_collect(const struct triangle_grid *grid, struct box box, const struct plane *planes,
                  int plane_count, struct stamped_set *seen, struct ids *out);
