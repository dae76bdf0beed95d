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

// ---- ids and volume ----

static uint32_t *keep(struct ids *ids, uint32_t *out_count) {
    ids_sort(ids);
    *out_count = ids->count;
    return ids->at;
}

static double six_volumes_of(const struct cut_mesh *mesh, const uint32_t corners[3], vec3 apex) {
    vec3 points[3];
    triangle_points(mesh, corners, points);
    return six_volumes(points, apex);
}

static void gather_triangles(struct cut_mesh *mesh, struct cut_change *change) {
    struct ids freed = {0}, made = {0};
    vec3 apex = mesh->grid.origin;
    double sum = 0;
    for (uint32_t i = 0; i < mesh->undo.triangle_count; i++) {
        const struct triangle_before *before = &mesh->undo.triangles[i];
        const uint32_t *corners = mesh->corners + 3 * (size_t)before->id;
        bool was = before->corners[0] != MESH_NONE, is = corners[0] != MESH_NONE;
        if (was && is && !memcmp(before->corners, corners, sizeof before->corners))
            continue;
        if (was)
            sum -= six_volumes_of(mesh, before->corners, apex);
        if (is)
            sum += six_volumes_of(mesh, corners, apex);
        if (is)
            ids_push(&made, before->id);
        else if (was)
            ids_push(&freed, before->id);
    }
    mesh->volume += sum / 6;
    change->volume_mm3 = mesh->volume;
    change->freed = keep(&freed, &change->freed_count);
    change->made = keep(&made, &change->made_count);
}

static void gather_vertices(struct cut_mesh *mesh, struct cut_change *change) {
    struct ids vertices = {0};
    for (uint32_t i = 0; i < mesh->undo.vertex_count; i++)
        if (mesh->undo.vertices[i].spoke == MESH_NONE &&
            cut_mesh_vertex_alive(mesh, mesh->undo.vertices[i].id))
            ids_push(&vertices, mesh->undo.vertices[i].id);
    change->vertices = keep(&vertices, &change->vertex_count);
}

void change_gather(struct cut_mesh *mesh, struct cut_change *change) {
    gather_triangles(mesh, change);
    gather_vertices(mesh, change);
}
