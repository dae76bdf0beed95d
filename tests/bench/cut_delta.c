#include "base/check.h"
#include "cut.h"
#include "wire/mesh_delta.h"

#include <stdlib.h>
#include <string.h>

static void set_vertices(const struct cut_mesh *mesh, const uint32_t *ids, uint32_t count,
                         struct mesh_delta *delta) {
    delta->vertex_count = count;
    delta->vertices = alloc(count, sizeof *delta->vertices);
    for (uint32_t i = 0; i < count; i++) {
        vec3 p = cut_mesh_vertex(mesh, ids[i]);
        delta->vertices[i] = (struct delta_vertex){ids[i], {(float)p.x, (float)p.y, (float)p.z}};
    }
}

static void set_made(const struct cut_mesh *mesh, const uint32_t *ids, uint32_t count,
                     struct mesh_delta *delta) {
    delta->made_count = count;
    delta->made = alloc(count, sizeof *delta->made);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *corners = cut_mesh_triangle(mesh, ids[i]);
        delta->made[i] = (struct delta_triangle){
            ids[i], {corners[0], corners[1], corners[2]}, cut_mesh_label(mesh, ids[i])};
    }
}

static void set_piece(const struct cut_piece *piece, struct delta_piece *out) {
    const struct mesh *mesh = &piece->mesh;
    vec3 c = piece->centroid;
    size_t positions = 3 * (size_t)mesh->vertex_count, corners = 3 * (size_t)mesh->triangle_count;
    *out = (struct delta_piece){(float)piece->volume,
                                {(float)c.x, (float)c.y, (float)c.z},
                                mesh->vertex_count,
                                mesh->triangle_count,
                                alloc(positions, sizeof(float)),
                                alloc(corners, sizeof(uint32_t))};
    memcpy(out->positions, mesh->positions, positions * sizeof(float));
    memcpy(out->triangles, mesh->triangles, corners * sizeof(uint32_t));
}

static size_t encoded(struct mesh_delta *delta) {
    size_t bound = mesh_delta_bound(delta);
    uint8_t *data = alloc(bound, 1);
    size_t used = mesh_delta_encode(delta, data, bound);
    free(data);
    mesh_delta_fini(delta);
    return used;
}

size_t cut_change_bytes(const struct cut_mesh *mesh, const struct cut_change *change) {
    struct mesh_delta delta = {.base = change->number, .number = change->number + 1};
    delta.freed_count = change->freed_count;
    delta.freed = alloc(change->freed_count, sizeof *delta.freed);
    memcpy(delta.freed, change->freed, change->freed_count * sizeof *delta.freed);
    set_vertices(mesh, change->vertices, change->vertex_count, &delta);
    set_made(mesh, change->made, change->made_count, &delta);
    delta.piece_count = (uint32_t)change->piece_count;
    delta.pieces = alloc((size_t)change->piece_count, sizeof *delta.pieces);
    for (int i = 0; i < change->piece_count; i++)
        set_piece(&change->pieces[i], &delta.pieces[i]);
    return encoded(&delta);
}

size_t cut_mesh_bytes(const struct cut_mesh *mesh) {
    uint32_t *vertices, *triangles;
    struct mesh flat;
    struct mesh_delta delta = {.number = 1};
    cut_mesh_flatten(mesh, &flat, &vertices, &triangles);
    set_vertices(mesh, vertices, flat.vertex_count, &delta);
    set_made(mesh, triangles, flat.triangle_count, &delta);
    mesh_fini(&flat);
    free(vertices);
    free(triangles);
    return encoded(&delta);
}
