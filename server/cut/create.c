#include "cut/clean.h"
#include "cut/cut.h"
#include "cut/flood.h"
#include "cut/stage.h"
#include "mesh/edges.h"
#include "mesh/topology.h"

#include <stdlib.h>
#include <string.h>

#define CELL_LEAST_MM 0.25

static enum result check_solid(const struct mesh *mesh, bool *out_hollow, struct error *err) {
    enum result result = mesh_validate(mesh, err);
    if (result != RESULT_OK)
        return result;
    struct topology topology = topology_of(mesh);
    *out_hollow = topology.components > 1;
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

static void take_arrays(struct cut_mesh *out, const struct mesh *mesh,
                        const struct triangle_side *sides) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    out->vertex_bound = out->vertex_room = out->original_count = mesh->vertex_count;
    out->triangle_bound = out->triangle_room = out->living = mesh->triangle_count;
    out->points = alloc(mesh->vertex_count, sizeof *out->points);
    out->vertex_sides = alloc(mesh->vertex_count, sizeof *out->vertex_sides);
    out->corners = array_copy(mesh->triangles, count, sizeof *out->corners);
    out->twins = alloc(count, sizeof *out->twins);
    out->labels = alloc(mesh->triangle_count, sizeof *out->labels);
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

static void create_scratch(struct cut_mesh *mesh) {
    mesh->stage = stage_create();
    mesh->flood = alloc(1, sizeof *mesh->flood);
    mesh->cleaner = alloc(1, sizeof *mesh->cleaner);
}

enum result cut_mesh_create(const struct mesh *mesh, struct cut_mesh **out_mesh,
                            struct error *err) {
    *out_mesh = NULL;
    bool hollow;
    enum result result = check_solid(mesh, &hollow, err);
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
    m->hollow = hollow;
    create_scratch(m);
    return RESULT_OK;
}

struct cut_mesh *cut_mesh_copy(const struct cut_mesh *mesh) {
    struct cut_mesh *copy = alloc(1, sizeof *copy);
    *copy = *mesh;
    copy->vertex_room = mesh->vertex_bound;
    copy->triangle_room = mesh->triangle_bound;
    copy->points = array_copy(mesh->points, mesh->vertex_bound, sizeof *mesh->points);
    copy->vertex_sides =
        array_copy(mesh->vertex_sides, mesh->vertex_bound, sizeof *mesh->vertex_sides);
    copy->corners = array_copy(mesh->corners, mesh->triangle_bound, 3 * sizeof *mesh->corners);
    copy->twins = array_copy(mesh->twins, mesh->triangle_bound, 3 * sizeof *mesh->twins);
    copy->labels = array_copy(mesh->labels, mesh->triangle_bound, sizeof *mesh->labels);
    copy->free_vertices = ids_copy(&mesh->free_vertices);
    copy->free_triangles = ids_copy(&mesh->free_triangles);
    grid_copy(&copy->grid, &mesh->grid);
    copy->undo = (struct undo){0};
    create_scratch(copy);
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
    stamped_set_fini(&m->undo.triangles_seen);
    stamped_set_fini(&m->undo.vertices_seen);
    free(m->undo.triangles);
    ids_fini(&m->undo.gone);
    free(m->undo.vertices);
    stage_destroy(&m->stage);
    flood_fini(m->flood);
    free(m->flood);
    cleaner_fini(m->cleaner);
    free(m->cleaner);
    free(m);
}
