// The data of a cut mesh: triangles that know their neighbours, free ids and a grid of triangles;
// while it is cut, an undo log, with which a cut that fails half way is taken back.
//
// Side 3 t + i of triangle t runs from its corner i to its corner i + 1; its twin is the side of
// the neighbour that runs back.
#pragma once

#include "cut/cut.h"
#include "cut/grid.h"

// A triangle and a vertex before the cut first changed them.
struct triangle_before {
    uint32_t id, corners[3], twins[3];
    uint32_t in_grid[3]; // the corners that the grid has it with
    uint32_t label;
};

struct vertex_before {
    uint32_t id, side;
};

struct undo {
    struct stamped_set triangles_seen, vertices_seen;
    struct triangle_before *triangles;
    struct vertex_before *vertices;
    uint32_t triangle_count, triangle_room, vertex_count, vertex_room;
    uint32_t vertex_bound, triangle_bound, living, free_vertices, free_triangles;
    bool hollow;
    struct ids gone; // scratch
};

struct stage;
struct flood;
struct cleaner;

// What a cut needs and no mesh keeps: memory that is warm for the next cut, of whichever mesh. Each
// has one user at a time; any thread may take one.
struct cut_scratch {
    struct undo undo;
    struct stage *stage;
    struct flood *flood;
    struct cleaner *cleaner;
};

struct cut_scratch *scratch_take(void);
void scratch_give(struct cut_scratch **scratch);

struct cut_mesh {
    uint32_t vertex_bound, vertex_room;
    uint32_t original_count; // vertices below this are those of the mesh that it was made from
    vec3 *points;
    uint32_t *vertex_sides; // a side that starts at the vertex; MESH_NONE: not alive
    uint32_t triangle_bound, triangle_room;
    uint32_t living;   // triangles
    uint32_t *corners; // MESH_NONE: not alive
    uint32_t *twins;
    uint32_t *labels;
    struct ids free_vertices, free_triangles; // used again from the end
    uint32_t number;                          // of the last cut that changed the mesh
    double volume;                            // mm³, kept up to date by what each cut changes
    bool hollow;                              // there may be cavities
    bool parted;                              // the mesh that it was made from had several parts
    struct triangle_grid grid;
    struct cut_scratch *scratch; // while it is cut
};

static inline uint32_t side_next(uint32_t side) {
    return side % 3 == 2 ? side - 2 : side + 1;
}

static inline uint32_t side_previous(uint32_t side) {
    return side % 3 == 0 ? side + 2 : side - 1;
}

static inline uint32_t side_end(const struct cut_mesh *mesh, uint32_t side) {
    return mesh->corners[side_next(side)];
}

// The next side that starts at the same vertex, clockwise seen from outside.
static inline uint32_t side_around(const struct cut_mesh *mesh, uint32_t side) {
    return side_next(mesh->twins[side]);
}

static inline void triangle_points(const struct cut_mesh *mesh, const uint32_t corners[3],
                                   vec3 out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = mesh->points[corners[i]];
}

// Six times the signed volume of the tetrahedron that a triangle makes with a point.
static inline double six_volumes(const vec3 c[3], vec3 apex) {
    return vec3_dot(vec3_sub(c[0], apex), vec3_cross(vec3_sub(c[1], apex), vec3_sub(c[2], apex)));
}
