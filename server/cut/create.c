#include "cut/cut_mesh.h"
#include "mesh/edges.h"
#include "mesh/topology.h"

#include <stdlib.h>
#include <string.h>

#define CELL_LEAST_MM 0.25

static enum result check_solid(const struct mesh *mesh, bool *out_parted, struct error *err) {
    enum result result = mesh_validate(mesh, err);
    if (result != RESULT_OK)
        return result;
    struct topology topology = topology_of(mesh);
    *out_parted = topology.components > 1;
    if (!topology.closed)
        return fail(err, RESULT_INVALID, "it has %u open edges", topology.open_edges);
    if (!topology.manifold)
        return fail(err, RESULT_INVALID,
                    "more than two triangles meet at an edge, or sheets touch");
    if (!topology.oriented)
        return fail(err, RESULT_INVALID, "%u edges have triangles that face different ways",
                    topology.flipped_edges);
    if (!(mesh_volume(mesh) > 0))
        return fail(err, RESULT_INVALID, "it faces inwards");
    return RESULT_OK;
}

static uint32_t side_of(const struct mesh *mesh, const struct triangle_side *side) {
    uint32_t from = side->forward ? side->low : side->high, i = 3 * side->triangle;
    while (mesh->triangles[i] != from)
        i++;
    return i;
}

static double mean_edge(const struct mesh *mesh, const struct triangle_side *sides) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    double sum = 0;
    for (size_t i = 0; i < count; i++)
        sum += vec3_distance(mesh_vertex(mesh, sides[i].low), mesh_vertex(mesh, sides[i].high));
    return sum / (double)count;
}

// With some for what cuts make, so that the first ones need not move all that there is.
static uint32_t room_of(uint32_t count) {
    return count + count / 4 + 256;
}

static void take_arrays(struct cut_mesh *out, const struct mesh *mesh,
                        const struct triangle_side *sides) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    out->vertex_bound = out->original_count = mesh->vertex_count;
    out->triangle_bound = out->living = mesh->triangle_count;
    out->vertex_room = room_of(mesh->vertex_count);
    out->triangle_room = room_of(mesh->triangle_count);
    out->points = alloc(out->vertex_room, sizeof *out->points);
    out->vertex_sides = alloc(out->vertex_room, sizeof *out->vertex_sides);
    out->corners = alloc(out->triangle_room, 3 * sizeof *out->corners);
    out->twins = alloc(out->triangle_room, 3 * sizeof *out->twins);
    out->labels = alloc(out->triangle_room, sizeof *out->labels);
    memcpy(out->corners, mesh->triangles, count * sizeof *out->corners);
    memset(out->vertex_sides, 0xff, mesh->vertex_count * sizeof *out->vertex_sides);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        out->points[v] = mesh_vertex(mesh, v);
    for (size_t i = count; i-- > 0;)
        out->vertex_sides[mesh->triangles[i]] = (uint32_t)i;
    for (size_t i = 0; i < count; i += 2) {
        uint32_t a = side_of(mesh, &sides[i]), b = side_of(mesh, &sides[i + 1]);
        out->twins[a] = b;
        out->twins[b] = a;
    }
}

enum result cut_mesh_create(const struct mesh *mesh, struct cut_mesh **out_mesh,
                            struct error *err) {
    *out_mesh = NULL;
    bool parted;
    enum result result = check_solid(mesh, &parted, err);
    if (result != RESULT_OK)
        return result;
    struct cut_mesh *m = *out_mesh = alloc(1, sizeof *m);
    struct triangle_side *sides = edges_sorted(mesh);
    take_arrays(m, mesh, sides);
    grid_init(&m->grid, mesh_bounds(mesh), fmax(CELL_LEAST_MM, 2 * mean_edge(mesh, sides)));
    free(sides);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 points[3];
        triangle_points(m, m->corners + 3 * (size_t)t, points);
        grid_add(&m->grid, t, points);
    }
    m->volume = cut_mesh_volume(m);
    m->hollow = m->parted = parted;
    return RESULT_OK;
}

static void *copy_into(uint32_t room, const void *memory, uint32_t count, size_t size) {
    return memcpy(alloc_resize(NULL, room, size), memory, count * size);
}

struct cut_mesh *cut_mesh_copy(const struct cut_mesh *mesh) {
    struct cut_mesh *copy = alloc(1, sizeof *copy);
    *copy = *mesh;
    uint32_t vertices = mesh->vertex_bound, triangles = mesh->triangle_bound;
    copy->vertex_room = room_of(vertices);
    copy->triangle_room = room_of(triangles);
    copy->points = copy_into(copy->vertex_room, mesh->points, vertices, sizeof *mesh->points);
    copy->vertex_sides =
        copy_into(copy->vertex_room, mesh->vertex_sides, vertices, sizeof *mesh->vertex_sides);
    copy->corners =
        copy_into(copy->triangle_room, mesh->corners, triangles, 3 * sizeof *mesh->corners);
    copy->twins = copy_into(copy->triangle_room, mesh->twins, triangles, 3 * sizeof *mesh->twins);
    copy->labels = copy_into(copy->triangle_room, mesh->labels, triangles, sizeof *mesh->labels);
    copy->free_vertices = ids_copy(&mesh->free_vertices);
    copy->free_triangles = ids_copy(&mesh->free_triangles);
    grid_copy(&copy->grid, &mesh->grid);
    return copy;
}

void cut_mesh_destroy(struct cut_mesh **mesh) {
    struct cut_mesh *m = *mesh;
    *mesh = NULL;
    if (!m)
        return;
    free(m->points);
    free(m->vertex_sides);
    free(m->corners);
    free(m->twins);
    free(m->labels);
    ids_fini(&m->free_vertices);
    ids_fini(&m->free_triangles);
    grid_fini(&m->grid);
    free(m);
}
