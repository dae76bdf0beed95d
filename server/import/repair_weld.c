#include "base/check.h"
#include "import/repair_steps.h"
#include "mesh/edges.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Vertices that were kept, by the cell of space that they lie in: an open hash table.
struct cells {
    double size; // mm; 0: a cell is one place
    uint32_t mask;
    uint32_t *vertices; // MESH_NONE: empty
};

struct cell {
    int64_t at[3];
};

// In steps of 2^-40 mm a cell is one place for any coordinate that a float tells apart.
static struct cell cell_of(const struct cells *cells, vec3 p) {
    double size = cells->size > 0 ? cells->size : 0x1p-40;
    return (struct cell){
        {(int64_t)floor(p.x / size), (int64_t)floor(p.y / size), (int64_t)floor(p.z / size)}};
}

static uint32_t slot_of(const struct cells *cells, struct cell cell) {
    uint64_t hash = 0;
    for (int i = 0; i < 3; i++) {
        hash = (hash ^ (uint64_t)cell.at[i]) * 0x9e3779b97f4a7c15u;
        hash ^= hash >> 29;
    }
    return (uint32_t)hash & cells->mask;
}

static uint32_t find_in_cell(const struct cells *cells, const struct mesh *mesh, struct cell cell,
                             vec3 p) {
    for (uint32_t slot = slot_of(cells, cell); cells->vertices[slot] != MESH_NONE;
         slot = (slot + 1) & cells->mask)
        if (vec3_distance(mesh_vertex(mesh, cells->vertices[slot]), p) <= cells->size)
            return cells->vertices[slot];
    return MESH_NONE;
}

// A vertex kept before that lies within the cell's size of p.
static uint32_t find_near(const struct cells *cells, const struct mesh *mesh, vec3 p) {
    struct cell centre = cell_of(cells, p);
    if (!(cells->size > 0))
        return find_in_cell(cells, mesh, centre, p);
    for (int i = 0; i < 27; i++) {
        struct cell cell = {
            {centre.at[0] + i % 3 - 1, centre.at[1] + i / 3 % 3 - 1, centre.at[2] + i / 9 - 1}};
        uint32_t found = find_in_cell(cells, mesh, cell, p);
        if (found != MESH_NONE)
            return found;
    }
    return MESH_NONE;
}

static void insert(struct cells *cells, uint32_t vertex, vec3 p) {
    uint32_t slot = slot_of(cells, cell_of(cells, p));
    while (cells->vertices[slot] != MESH_NONE)
        slot = (slot + 1) & cells->mask;
    cells->vertices[slot] = vertex;
}

static struct cells cells_for(uint32_t vertex_count, double size) {
    struct cells cells = {.size = size, .mask = 1};
    while (cells.mask < 2 * (uint64_t)vertex_count)
        cells.mask = 2 * cells.mask + 1;
    cells.vertices = alloc((size_t)cells.mask + 1, sizeof *cells.vertices);
    memset(cells.vertices, 0xff, ((size_t)cells.mask + 1) * sizeof *cells.vertices);
    return cells;
}

void repair_weld(struct mesh *mesh, double weld_mm, struct repair_report *report) {
    bool *open = edges_open_vertices(mesh);
    uint32_t *becomes = sets_create(mesh->vertex_count);
    struct cells cells = cells_for(mesh->vertex_count, weld_mm);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (!open[v])
            continue;
        vec3 p = mesh_vertex(mesh, v);
        uint32_t found = find_near(&cells, mesh, p);
        if (found == MESH_NONE) {
            insert(&cells, v, p);
            continue;
        }
        becomes[v] = found;
        report->welded_vertices++;
        repair_at(report, REPAIR_WELDED, p);
        report->welded_mm = fmax(report->welded_mm, vec3_distance(p, mesh_vertex(mesh, found)));
    }
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        mesh->triangles[i] = becomes[mesh->triangles[i]];
    free(cells.vertices);
    free(becomes);
    free(open);
}
