#include "runtime/tissue_delta.h"

#include "base/check.h"

#include <string.h>

static void take_point(float out[3], vec3 p) {
    out[0] = (float)p.x;
    out[1] = (float)p.y;
    out[2] = (float)p.z;
}

static struct delta_vertex vertex_of(const struct cut_mesh *mesh, uint32_t id) {
    struct delta_vertex vertex = {.id = id};
    take_point(vertex.position, cut_mesh_vertex(mesh, id));
    return vertex;
}

static struct delta_triangle triangle_of(const struct cut_mesh *mesh, uint32_t id) {
    struct delta_triangle triangle = {.id = id, .label = cut_mesh_label(mesh, id)};
    memcpy(triangle.corners, cut_mesh_triangle(mesh, id), sizeof triangle.corners);
    return triangle;
}

// ---- a change -----------------------------------------------------------------------------------

static void take_piece(const struct cut_piece *piece, struct delta_piece *out) {
    const struct mesh *mesh = &piece->mesh;
    *out = (struct delta_piece){
        .volume_mm3 = (float)piece->volume,
        .vertex_count = mesh->vertex_count,
        .triangle_count = mesh->triangle_count,
        .positions = alloc(3 * (size_t)mesh->vertex_count, sizeof(float)),
        .triangles = alloc(3 * (size_t)mesh->triangle_count, sizeof(uint32_t)),
    };
    take_point(out->centroid, piece->centroid);
    memcpy(out->positions, mesh->positions, 3 * sizeof(float) * (size_t)mesh->vertex_count);
    memcpy(out->triangles, mesh->triangles, 3 * sizeof(uint32_t) * (size_t)mesh->triangle_count);
}

void tissue_delta_add_pieces(const struct cut_change *change, struct mesh_delta *out) {
    uint32_t count = (uint32_t)change->piece_count;
    out->piece_count = count < MESH_DELTA_PIECES_MAX ? count : MESH_DELTA_PIECES_MAX;
    out->pieces = alloc(out->piece_count + 1, sizeof *out->pieces);
    for (uint32_t i = 0; i < out->piece_count; i++)
        take_piece(&change->pieces[i], &out->pieces[i]);
}

void tissue_delta_of_change(const struct cut_mesh *mesh, const struct cut_change *change,
                            struct mesh_delta *out) {
    *out = (struct mesh_delta){
        .freed_count = change->freed_count,
        .vertex_count = change->vertex_count,
        .made_count = change->made_count,
        .freed = alloc(change->freed_count + 1, sizeof *out->freed),
        .vertices = alloc(change->vertex_count + 1, sizeof *out->vertices),
        .made = alloc(change->made_count + 1, sizeof *out->made),
    };
    if (change->freed_count)
        memcpy(out->freed, change->freed, change->freed_count * sizeof *out->freed);
    for (uint32_t i = 0; i < change->vertex_count; i++)
        out->vertices[i] = vertex_of(mesh, change->vertices[i]);
    for (uint32_t i = 0; i < change->made_count; i++)
        out->made[i] = triangle_of(mesh, change->made[i]);
    tissue_delta_add_pieces(change, out);
}

// ---- all that differs ---------------------------------------------------------------------------

static bool is_same_vertex(const struct tissue *before, const struct delta_vertex *vertex) {
    return vertex->id < before->vertex_bound && before->uses[vertex->id] &&
           !memcmp(before->positions + 3 * (size_t)vertex->id, vertex->position,
                   sizeof vertex->position);
}

// Ids are used again, so a triangle that has the corners that it had may have moved with them.
static bool is_same_triangle(const struct tissue *before, const struct cut_mesh *mesh,
                             uint32_t id) {
    const uint32_t *corners = cut_mesh_triangle(mesh, id);
    if (!tissue_triangle_alive(before, id) || before->labels[id] != cut_mesh_label(mesh, id) ||
        memcmp(before->corners + 3 * (size_t)id, corners, 3 * sizeof *corners) != 0)
        return false;
    for (int i = 0; i < 3; i++) {
        struct delta_vertex corner = vertex_of(mesh, corners[i]);
        if (!is_same_vertex(before, &corner))
            return false;
    }
    return true;
}

void tissue_delta_between(const struct tissue *before, const struct cut_mesh *mesh,
                          struct mesh_delta *out) {
    uint32_t vertices = cut_mesh_vertex_bound(mesh), triangles = cut_mesh_triangle_bound(mesh);
    *out = (struct mesh_delta){
        .freed = alloc(before->triangle_bound + 1, sizeof *out->freed),
        .vertices = alloc(vertices + 1, sizeof *out->vertices),
        .made = alloc(triangles + 1, sizeof *out->made),
    };
    for (uint32_t i = 0; i < before->triangle_bound; i++)
        if (tissue_triangle_alive(before, i) &&
            !(i < triangles && cut_mesh_triangle_alive(mesh, i)))
            out->freed[out->freed_count++] = i;
    for (uint32_t i = 0; i < vertices; i++) {
        if (!cut_mesh_vertex_alive(mesh, i))
            continue;
        struct delta_vertex vertex = vertex_of(mesh, i);
        if (!is_same_vertex(before, &vertex))
            out->vertices[out->vertex_count++] = vertex;
    }
    for (uint32_t i = 0; i < triangles; i++)
        if (cut_mesh_triangle_alive(mesh, i) && !is_same_triangle(before, mesh, i))
            out->made[out->made_count++] = triangle_of(mesh, i);
}

void tissue_delta_whole(const struct cut_mesh *mesh, struct mesh_delta *out) {
    struct tissue nothing = {0};
    tissue_delta_between(&nothing, mesh, out);
}
