#include "cut/change.h"

#include <stdlib.h>
#include <string.h>

void cut_change_fini(struct cut_change *change) {
    free(change->freed);
    free(change->made);
    free(change->vertices);
    free(change->patches);
    for (int i = 0; i < change->piece_count; i++)
        mesh_fini(&change->pieces[i].mesh);
    free(change->pieces);
    *change = (struct cut_change){0};
}

static bool is_same(const struct cut_mesh *mesh, const struct triangle_before *before) {
    const uint32_t *corners = mesh->corners + 3 * (size_t)before->id;
    return before->corners[0] != MESH_NONE &&
           !memcmp(before->corners, corners, sizeof before->corners);
}

// ---- volume ----

static double six_volumes_of(const struct cut_mesh *mesh, const uint32_t corners[3], vec3 apex) {
    vec3 points[3];
    if (corners[0] == MESH_NONE)
        return 0;
    triangle_points(mesh, corners, points);
    return six_volumes(points, apex);
}

void change_update_volume(struct cut_mesh *mesh) {
    vec3 apex = mesh->grid.origin;
    double sum = 0;
    for (uint32_t i = 0; i < mesh->scratch->undo.triangle_count; i++) {
        const struct triangle_before *before = &mesh->scratch->undo.triangles[i];
        if (!is_same(mesh, before))
            sum += six_volumes_of(mesh, mesh->corners + 3 * (size_t)before->id, apex) -
                   six_volumes_of(mesh, before->corners, apex);
    }
    mesh->volume += sum / 6;
}

// ---- ids ----

static uint32_t *keep(struct ids *ids, uint32_t *out_count) {
    ids_sort(ids);
    *out_count = ids->count;
    return ids->at;
}

static void list_changed_triangles(struct cut_mesh *mesh, struct cut_change *change) {
    struct ids freed = {0}, made = {0};
    for (uint32_t i = 0; i < mesh->scratch->undo.triangle_count; i++) {
        const struct triangle_before *before = &mesh->scratch->undo.triangles[i];
        if (is_same(mesh, before))
            continue;
        if (cut_mesh_triangle_alive(mesh, before->id))
            ids_push(&made, before->id);
        else if (before->corners[0] != MESH_NONE)
            ids_push(&freed, before->id);
    }
    change->freed = keep(&freed, &change->freed_count);
    change->made = keep(&made, &change->made_count);
}

static void list_vertices(struct cut_mesh *mesh, struct cut_change *change) {
    struct ids vertices = {0};
    for (uint32_t i = 0; i < mesh->scratch->undo.vertex_count; i++)
        if (mesh->scratch->undo.vertices[i].side == MESH_NONE &&
            cut_mesh_vertex_alive(mesh, mesh->scratch->undo.vertices[i].id))
            ids_push(&vertices, mesh->scratch->undo.vertices[i].id);
    change->vertices = keep(&vertices, &change->vertex_count);
}

void change_list_ids(struct cut_mesh *mesh, struct cut_change *change) {
    list_changed_triangles(mesh, change);
    list_vertices(mesh, change);
}
