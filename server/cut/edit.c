#include "cut/edit.h"

#include <string.h>

// ---- what a cut touches ----

void edit_begin(struct cut_mesh *mesh) {
    struct undo *undo = &mesh->scratch->undo;
    stamped_set_begin(&undo->triangles_seen, mesh->triangle_room);
    stamped_set_begin(&undo->vertices_seen, mesh->vertex_room);
    undo->triangle_count = undo->vertex_count = 0;
    undo->vertex_bound = mesh->vertex_bound;
    undo->triangle_bound = mesh->triangle_bound;
    undo->living = mesh->living;
    undo->hollow = mesh->hollow;
    undo->free_vertices = mesh->free_vertices.count;
    undo->free_triangles = mesh->free_triangles.count;
}

static void touch_triangle(struct cut_mesh *mesh, uint32_t triangle) {
    struct undo *undo = &mesh->scratch->undo;
    if (stamped_set_has(&undo->triangles_seen, triangle))
        return;
    stamped_set_put(&undo->triangles_seen, triangle, 0);
    undo->triangles = array_grow(undo->triangles, &undo->triangle_room, undo->triangle_count + 1,
                                 sizeof *undo->triangles);
    const uint32_t *c = mesh->corners + 3 * (size_t)triangle;
    const uint32_t *t = mesh->twins + 3 * (size_t)triangle;
    undo->triangles[undo->triangle_count++] = (struct triangle_before){triangle,
                                                                       {c[0], c[1], c[2]},
                                                                       {t[0], t[1], t[2]},
                                                                       {c[0], c[1], c[2]},
                                                                       mesh->labels[triangle]};
}

static void touch_vertex(struct cut_mesh *mesh, uint32_t vertex) {
    struct undo *undo = &mesh->scratch->undo;
    if (stamped_set_has(&undo->vertices_seen, vertex))
        return;
    stamped_set_put(&undo->vertices_seen, vertex, 0);
    undo->vertices = array_grow(undo->vertices, &undo->vertex_room, undo->vertex_count + 1,
                                sizeof *undo->vertices);
    undo->vertices[undo->vertex_count++] =
        (struct vertex_before){vertex, mesh->vertex_sides[vertex]};
}

// ---- the grid ----

static void settle_triangle(struct cut_mesh *mesh, struct triangle_before *before) {
    const uint32_t *corners = mesh->corners + 3 * (size_t)before->id;
    vec3 points[3];
    if (!memcmp(before->in_grid, corners, sizeof before->in_grid))
        return;
    if (before->in_grid[0] != MESH_NONE) {
        triangle_points(mesh, before->in_grid, points);
        grid_remove(&mesh->grid, before->id, points);
    }
    if (corners[0] != MESH_NONE) {
        triangle_points(mesh, corners, points);
        grid_add(&mesh->grid, before->id, points);
    }
    memcpy(before->in_grid, corners, sizeof before->in_grid);
}

static void settle(struct cut_mesh *mesh) {
    for (uint32_t i = 0; i < mesh->scratch->undo.triangle_count; i++)
        settle_triangle(mesh, &mesh->scratch->undo.triangles[i]);
}

// ---- undo ----

static void restore_triangle(struct cut_mesh *mesh, const struct triangle_before *before) {
    for (size_t i = 0; i < 3; i++) {
        mesh->corners[3 * (size_t)before->id + i] = before->corners[i];
        mesh->twins[3 * (size_t)before->id + i] = before->twins[i];
    }
    mesh->labels[before->id] = before->label;
}

void edit_undo(struct cut_mesh *mesh) {
    struct undo *undo = &mesh->scratch->undo;
    for (uint32_t i = 0; i < undo->triangle_count; i++)
        restore_triangle(mesh, &undo->triangles[i]);
    settle(mesh);
    for (uint32_t i = 0; i < undo->vertex_count; i++)
        mesh->vertex_sides[undo->vertices[i].id] = undo->vertices[i].side;
    mesh->vertex_bound = undo->vertex_bound;
    mesh->triangle_bound = undo->triangle_bound;
    mesh->living = undo->living;
    mesh->hollow = undo->hollow;
    mesh->free_vertices.count = undo->free_vertices;
    mesh->free_triangles.count = undo->free_triangles;
}

// ---- commit ----

// The lowest id is used first.
static void append_descending(struct ids *free_ids, struct ids *gone) {
    ids_sort(gone);
    for (uint32_t i = gone->count; i-- > 0;)
        ids_push(free_ids, gone->at[i]);
    gone->count = 0;
}

void edit_commit(struct cut_mesh *mesh) {
    struct undo *undo = &mesh->scratch->undo;
    settle(mesh);
    for (uint32_t i = 0; i < undo->triangle_count; i++)
        if (!cut_mesh_triangle_alive(mesh, undo->triangles[i].id))
            ids_push(&undo->gone, undo->triangles[i].id);
    append_descending(&mesh->free_triangles, &undo->gone);
    for (uint32_t i = 0; i < undo->vertex_count; i++)
        if (undo->vertices[i].id >= mesh->original_count &&
            !cut_mesh_vertex_alive(mesh, undo->vertices[i].id))
            ids_push(&undo->gone, undo->vertices[i].id);
    append_descending(&mesh->free_vertices, &undo->gone);
}

// ---- vertices ----

uint32_t edit_take_vertex(struct cut_mesh *mesh, vec3 point) {
    uint32_t id;
    if (mesh->free_vertices.count) {
        id = mesh->free_vertices.at[--mesh->free_vertices.count];
    } else {
        id = mesh->vertex_bound++;
        if (mesh->vertex_bound > mesh->vertex_room) {
            uint32_t room = mesh->vertex_room;
            mesh->points = array_grow(mesh->points, &mesh->vertex_room, mesh->vertex_bound,
                                      sizeof *mesh->points);
            mesh->vertex_sides = array_grow(mesh->vertex_sides, &room, mesh->vertex_bound,
                                            sizeof *mesh->vertex_sides);
            stamped_set_reserve(&mesh->scratch->undo.vertices_seen, mesh->vertex_room);
        }
        mesh->vertex_sides[id] = MESH_NONE;
    }
    mesh->points[id] = point;
    return id;
}

struct vertex_mark edit_mark_vertices(const struct cut_mesh *mesh) {
    return (struct vertex_mark){mesh->vertex_bound, mesh->free_vertices.count};
}

void edit_return_vertices(struct cut_mesh *mesh, struct vertex_mark mark) {
    mesh->vertex_bound = mark.bound;
    mesh->free_vertices.count = mark.free_count;
}

void edit_set_vertex_side(struct cut_mesh *mesh, uint32_t vertex, uint32_t side) {
    touch_vertex(mesh, vertex);
    mesh->vertex_sides[vertex] = side;
}

// ---- triangles ----

static uint32_t take_triangle(struct cut_mesh *mesh) {
    if (mesh->free_triangles.count)
        return mesh->free_triangles.at[--mesh->free_triangles.count];
    uint32_t id = mesh->triangle_bound++;
    if (mesh->triangle_bound > mesh->triangle_room) {
        uint32_t corners = mesh->triangle_room, twins = mesh->triangle_room;
        mesh->labels = array_grow(mesh->labels, &mesh->triangle_room, mesh->triangle_bound,
                                  sizeof *mesh->labels);
        mesh->corners =
            array_grow(mesh->corners, &corners, mesh->triangle_bound, 3 * sizeof *mesh->corners);
        mesh->twins =
            array_grow(mesh->twins, &twins, mesh->triangle_bound, 3 * sizeof *mesh->twins);
        stamped_set_reserve(&mesh->scratch->undo.triangles_seen, mesh->triangle_room);
    }
    for (size_t i = 0; i < 3; i++)
        mesh->corners[3 * (size_t)id + i] = mesh->twins[3 * (size_t)id + i] = MESH_NONE;
    mesh->labels[id] = 0;
    return id;
}

uint32_t edit_add_triangle(struct cut_mesh *mesh, const uint32_t corners[3], uint32_t label) {
    uint32_t id = take_triangle(mesh);
    touch_triangle(mesh, id);
    for (size_t i = 0; i < 3; i++)
        mesh->corners[3 * (size_t)id + i] = corners[i];
    mesh->labels[id] = label;
    mesh->living++;
    return id;
}

void edit_remove_triangle(struct cut_mesh *mesh, uint32_t triangle) {
    touch_triangle(mesh, triangle);
    for (size_t i = 0; i < 3; i++)
        mesh->corners[3 * (size_t)triangle + i] = MESH_NONE;
    mesh->living--;
}

void edit_move_corner(struct cut_mesh *mesh, uint32_t side, uint32_t vertex) {
    touch_triangle(mesh, side / 3);
    mesh->corners[side] = vertex;
}

void edit_join(struct cut_mesh *mesh, uint32_t side, uint32_t twin) {
    touch_triangle(mesh, side / 3);
    touch_triangle(mesh, twin / 3);
    mesh->twins[side] = twin;
    mesh->twins[twin] = side;
}
