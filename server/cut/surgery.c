#include "cut/surgery.h"

#include "cut/edit.h"

static bool are_neighbours(const struct cut_mesh *mesh, uint32_t a, uint32_t b) {
    uint32_t first = mesh->vertex_sides[a], side = first;
    do {
        if (side_end(mesh, side) == b)
            return true;
        side = side_around(mesh, side);
    } while (side != first);
    return false;
}

static bool has_three_neighbours(const struct cut_mesh *mesh, uint32_t vertex) {
    uint32_t first = mesh->vertex_sides[vertex];
    return side_around(mesh, side_around(mesh, side_around(mesh, first))) == first;
}

// ---- merge ----

// The ends of the side have no neighbours in common but the two corners across it, and those keep
// three of their own.
bool surgery_can_merge(const struct cut_mesh *mesh, uint32_t side) {
    uint32_t from = mesh->corners[side], to = side_end(mesh, side);
    uint32_t left = mesh->corners[side_previous(side)];
    uint32_t right = mesh->corners[side_previous(mesh->twins[side])];
    if (has_three_neighbours(mesh, left) || has_three_neighbours(mesh, right))
        return false;
    for (uint32_t s = side_around(mesh, side); s != side; s = side_around(mesh, s)) {
        uint32_t end = side_end(mesh, s);
        if (end != left && end != right && are_neighbours(mesh, to, end))
            return false;
    }
    return from != to;
}

void surgery_merge(struct cut_mesh *mesh, uint32_t side) {
    uint32_t twin = mesh->twins[side];
    uint32_t from = mesh->corners[side], to = side_end(mesh, side);
    uint32_t left = mesh->corners[side_previous(side)];
    uint32_t right = mesh->corners[side_previous(twin)];
    uint32_t left_in = mesh->twins[side_next(side)], left_out = mesh->twins[side_previous(side)];
    uint32_t right_in = mesh->twins[side_next(twin)], right_out = mesh->twins[side_previous(twin)];
    for (uint32_t s = side_around(mesh, side_next(twin)), next; s != side; s = next) {
        next = side_around(mesh, s);
        edit_move_corner(mesh, s, to);
    }
    edit_remove_triangle(mesh, side / 3);
    edit_remove_triangle(mesh, twin / 3);
    edit_join(mesh, left_in, left_out);
    edit_join(mesh, right_in, right_out);
    edit_set_vertex_side(mesh, from, MESH_NONE);
    edit_set_vertex_side(mesh, to, left_out);
    edit_set_vertex_side(mesh, left, left_in);
    edit_set_vertex_side(mesh, right, right_in);
}

// ---- flip ----

bool surgery_can_flip(const struct cut_mesh *mesh, uint32_t side) {
    return !are_neighbours(mesh, mesh->corners[side_previous(side)],
                           mesh->corners[side_previous(mesh->twins[side])]);
}

void surgery_flip(struct cut_mesh *mesh, uint32_t side) {
    uint32_t twin = mesh->twins[side];
    uint32_t after = side_next(side), twin_after = side_next(twin);
    uint32_t p = mesh->corners[side], q = mesh->corners[twin];
    uint32_t v = mesh->corners[side_previous(side)], r = mesh->corners[side_previous(twin)];
    uint32_t beyond_after = mesh->twins[after], beyond_twin_after = mesh->twins[twin_after];
    edit_move_corner(mesh, after, r);
    edit_move_corner(mesh, twin_after, v);
    edit_join(mesh, side, beyond_twin_after);
    edit_join(mesh, twin, beyond_after);
    edit_join(mesh, after, twin_after);
    edit_set_vertex_side(mesh, p, side);
    edit_set_vertex_side(mesh, q, twin);
    mesh->labels[side / 3] = mesh->labels[twin / 3];
}
