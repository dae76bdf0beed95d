#include "mesh/topology.h"

#include "base/check.h"
#include "mesh/edges.h"

#include <stdlib.h>
#include <string.h>

// ---- edges ----

static uint32_t count_edges(const struct mesh *mesh, uint32_t *fans, struct topology *out) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct triangle_side *sides = edges_sorted(mesh);
    uint32_t edges = 0;
    for (size_t i = 0, end; i < count; i = end, edges++) {
        end = edges_end(sides, i, count);
        out->open_edges += end - i == 1;
        out->non_manifold_edges += end - i > 2;
        out->flipped_edges += end - i == 2 && sides[i].forward == sides[i + 1].forward;
        for (size_t k = i + 1; k < end; k++)
            edges_join_fans(mesh, fans, &sides[i], &sides[k]);
    }
    free(sides);
    return edges;
}

// ---- vertices ----

// A vertex with more than one fan of corners is a point where sheets touch.
static void count_fans(const struct mesh *mesh, uint32_t *fans, struct topology *out) {
    uint32_t *fan_of = alloc(mesh->vertex_count, sizeof *fan_of);
    uint8_t *pinched = alloc(mesh->vertex_count, 1);
    memset(fan_of, 0xff, mesh->vertex_count * sizeof *fan_of);
    for (uint32_t corner = 0; corner < 3 * mesh->triangle_count; corner++) {
        uint32_t vertex = mesh->triangles[corner], fan = sets_find(fans, corner);
        if (fan_of[vertex] == MESH_NONE)
            fan_of[vertex] = fan;
        else if (fan_of[vertex] != fan && !pinched[vertex])
            out->non_manifold_vertices += pinched[vertex] = 1;
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        out->unused_vertices += fan_of[v] == MESH_NONE;
    free(pinched);
    free(fan_of);
}

static uint32_t count_components(const struct mesh *mesh, uint32_t unused_vertices) {
    uint32_t *parent = sets_create(mesh->vertex_count);
    uint32_t components = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        sets_join(parent, mesh->triangles[3 * t], mesh->triangles[3 * t + 1]);
        sets_join(parent, mesh->triangles[3 * t], mesh->triangles[3 * t + 2]);
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        components += parent[v] == v;
    free(parent);
    return components - unused_vertices;
}

struct topology topology_of(const struct mesh *mesh) {
    CHECK(mesh->triangle_count < UINT32_MAX / 3);
    struct topology out = {0};
    uint32_t *fans = sets_create(3 * mesh->triangle_count);
    uint32_t edges = count_edges(mesh, fans, &out);
    count_fans(mesh, fans, &out);
    free(fans);
    out.components = count_components(mesh, out.unused_vertices);
    out.closed = !out.open_edges;
    out.manifold = !out.non_manifold_edges && !out.non_manifold_vertices;
    out.oriented = !out.flipped_edges;
    out.euler = (int64_t)mesh->vertex_count - out.unused_vertices - edges + mesh->triangle_count;
    bool sound = out.closed && out.manifold && out.oriented;
    out.genus = sound ? out.components - out.euler / 2 : -1;
    return out;
}
