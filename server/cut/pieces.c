#include "cut/change.h"
#include "cut/edit.h"
#include "cut/flood.h"
#include "cut/stage.h"

#include <stdlib.h>

#define DEBRIS_MM3 1e-6 // what is smaller has no inside to speak of

// ---- bodies ----

// With the cavities that are in it.
static void list_body_triangles(const struct cut_mesh *mesh, const struct flood *flood,
                                uint32_t body, struct ids *out) {
    out->count = 0;
    for (uint32_t e = flood->bodies[body].done.first; e != MESH_NONE; e = flood->entries[e].next)
        ids_push(out, flood->entries[e].triangle);
    if (mesh->hollow)
        hollow_append(mesh, &flood->cavities, &mesh->scratch->stage->slots, out);
    ids_sort(out);
}

struct volume_moments {
    double six_volumes;
    vec3 apex;
    vec3 sum; // of six volumes times four centroids from the apex
};

static struct volume_moments moments_of(const struct cut_mesh *mesh, const struct ids *triangles) {
    struct volume_moments moments = {.apex =
                                         mesh->points[mesh->corners[3 * (size_t)triangles->at[0]]]};
    for (uint32_t i = 0; i < triangles->count; i++) {
        vec3 p[3];
        triangle_points(mesh, mesh->corners + 3 * (size_t)triangles->at[i], p);
        double six = six_volumes(p, moments.apex);
        moments.six_volumes += six;
        for (int k = 0; k < 3; k++)
            moments.sum = vec3_add_scaled(moments.sum, six, vec3_sub(p[k], moments.apex));
    }
    return moments;
}

// ---- which body stays ----

struct shares {
    uint32_t growing; // the body that is not whole; MESH_NONE: there is none
    uint32_t largest; // of the whole ones
    double rest;      // volume of all that is in no whole body
};

static struct shares share_out(const struct cut_mesh *mesh, struct flood *flood, double *volumes) {
    struct shares shares = {MESH_NONE, MESH_NONE, mesh->volume};
    struct ids triangles = {0};
    for (uint32_t b = 0; b < flood->body_count; b++) {
        if (flood->bodies[b].parent != b)
            continue;
        if (!flood->bodies[b].whole) {
            shares.growing = b;
            continue;
        }
        list_body_triangles(mesh, flood, b, &triangles);
        volumes[b] = moments_of(mesh, &triangles).six_volumes / 6;
        if (volumes[b] > 0)
            shares.rest -= volumes[b];
        if (shares.largest == MESH_NONE || volumes[b] > volumes[shares.largest])
            shares.largest = b;
    }
    ids_fini(&triangles);
    return shares;
}

static void finish_all(const struct cut_mesh *mesh, struct flood *flood) {
    for (uint32_t b = 0; b < flood->body_count; b++)
        if (flood->bodies[b].parent == b)
            flood_finish(mesh, flood, b);
}

// The body that stays, and the volumes of those that do not.
static uint32_t find_largest(const struct cut_mesh *mesh, struct flood *flood, double *volumes) {
    struct shares shares = share_out(mesh, flood, volumes);
    if (shares.growing == MESH_NONE)
        return shares.largest;
    if (shares.largest == MESH_NONE || shares.rest >= volumes[shares.largest])
        return shares.growing;
    finish_all(mesh, flood);
    return share_out(mesh, flood, volumes).largest;
}

// ---- a piece ----

static struct mesh mesh_of(const struct cut_mesh *mesh, struct flood *flood,
                           const struct ids *triangles, struct ids *vertices) {
    struct mesh out;
    stamped_set_begin(&flood->owner, mesh->vertex_room);
    vertices->count = 0;
    for (uint32_t i = 0; i < 3 * triangles->count; i++) {
        uint32_t vertex = mesh->corners[3 * (size_t)triangles->at[i / 3] + i % 3];
        if (!stamped_set_has(&flood->owner, vertex))
            ids_push(vertices, vertex);
        stamped_set_put(&flood->owner, vertex, 0);
    }
    ids_sort(vertices);
    mesh_init(&out, vertices->count, triangles->count);
    for (uint32_t v = 0; v < vertices->count; v++) {
        stamped_set_put(&flood->owner, vertices->at[v], v);
        mesh_set_vertex(&out, v, mesh->points[vertices->at[v]]);
    }
    for (uint32_t i = 0; i < 3 * triangles->count; i++)
        out.triangles[i] =
            stamped_set_get(&flood->owner, mesh->corners[3 * (size_t)triangles->at[i / 3] + i % 3]);
    return out;
}

// Takes a body out of the mesh, its cavities with it.
static struct cut_piece take_out(struct cut_mesh *mesh, struct flood *flood, uint32_t body) {
    struct ids triangles = {0}, vertices = {0};
    struct cut_piece piece = {0};
    list_body_triangles(mesh, flood, body, &triangles);
    struct volume_moments moments = moments_of(mesh, &triangles);
    piece.volume = moments.six_volumes / 6;
    piece.centroid = vec3_add_scaled(moments.apex, 1 / (4 * moments.six_volumes), moments.sum);
    piece.mesh = mesh_of(mesh, flood, &triangles, &vertices);
    for (uint32_t i = 0; i < triangles.count; i++)
        edit_remove_triangle(mesh, triangles.at[i]);
    for (uint32_t v = 0; v < vertices.count; v++)
        edit_set_vertex_side(mesh, vertices.at[v], MESH_NONE);
    mesh->volume -= piece.volume;
    ids_fini(&triangles);
    ids_fini(&vertices);
    return piece;
}

static void add_piece(struct cut_change *change, struct cut_piece piece) {
    change->pieces =
        alloc_resize(change->pieces, (size_t)change->piece_count + 1, sizeof *change->pieces);
    change->pieces[change->piece_count++] = piece;
}

// The largest body stays. Cavities stay with the body that they are in; what is next to nothing
// just goes.
void change_take_pieces(struct cut_mesh *mesh, struct cut_change *change) {
    struct flood *flood = mesh->scratch->flood;
    if (flood_run(mesh, flood) < 2)
        return;
    double *volumes = alloc(flood->body_count, sizeof *volumes);
    if (mesh->hollow)
        hollow_find(mesh, &mesh->scratch->stage->slots, &flood->cavities);
    mesh->hollow = flood->cavities.ends.count > 0; // there may be none any more
    uint32_t largest = find_largest(mesh, flood, volumes);
    for (uint32_t b = 0; b < flood->body_count; b++) {
        if (flood->bodies[b].parent != b || b == largest || volumes[b] < -DEBRIS_MM3)
            continue;
        struct cut_piece piece = take_out(mesh, flood, b);
        if (piece.volume > DEBRIS_MM3)
            add_piece(change, piece);
        else
            mesh_fini(&piece.mesh);
    }
    cavities_fini(&flood->cavities);
    free(volumes);
}
