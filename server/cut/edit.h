// Edits of a cut mesh. All edits since edit_begin can be undone together.
#pragma once

#include "cut/cut_mesh.h"

// Every edit lies between edit_begin and edit_commit or edit_undo, which bring the grid up to date.
void edit_begin(struct cut_mesh *mesh);
void edit_undo(struct cut_mesh *mesh);
void edit_commit(struct cut_mesh *mesh); // frees the ids of what was removed

// A taken vertex has an id and a position. Its first edit_set_vertex_side, even to MESH_NONE, puts
// it into the undo log; before that it can be returned.
uint32_t edit_take_vertex(struct cut_mesh *mesh, vec3 point);
struct vertex_mark {
    uint32_t bound, free_count;
};
struct vertex_mark edit_mark_vertices(const struct cut_mesh *mesh);
void edit_return_vertices(struct cut_mesh *mesh, struct vertex_mark mark); // taken since

void edit_set_vertex_side(struct cut_mesh *mesh, uint32_t vertex, uint32_t side);
uint32_t edit_add_triangle(struct cut_mesh *mesh, const uint32_t corners[3], uint32_t label);
void edit_remove_triangle(struct cut_mesh *mesh, uint32_t triangle);
void edit_move_corner(struct cut_mesh *mesh, uint32_t side, uint32_t vertex);
void edit_join(struct cut_mesh *mesh, uint32_t side, uint32_t twin);
