#include "mesh/topology.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

// One side of a triangle. Sorted by its two ends, the sides of one edge lie together.
struct side {
    uint32_t low, high;
    uint32_t triangle;
    bool forward; // the triangle runs from low to high
};

static int compare_sides(const void *a, const void *b) {
    const struct side *s = a, *t = b;
    if (s->low != t->low)
        return s->low < t->low ? -1 : 1;
    if (s->high != t->high)
        return s->high < t->high ? -1 : 1;
    return s->triangle < t->triangle ? -1 : s->triangle > t->triangle;
}

static struct side *sorted_sides(const struct mesh *mesh) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct side *sides = alloc(count, sizeof *sides);
    for (size_t i = 0; i < count; i++) {
        uint32_t from = mesh->triangles[i];
        uint32_t to = mesh->triangles[i - i % 3 + (i + 1) % 3];
        sides[i] = from < to ? (struct side){from, to, (uint32_t)(i / 3), true}
                             : (struct side){to, from, (uint32_t)(i / 3), false};
    }
    qsort(sides, count, sizeof *sides, compare_sides);
    return sides;
}

// ---- union of sets, by path halving ----

static uint32_t *singletons(uint32_t count) {
    uint32_t *parent = alloc(count, sizeof *parent);
    for (uint32_t i = 0; i < count; i++)
        parent[i] = i;
    return parent;
}

static uint32_t find(uint32_t *parent, uint32_t i) {
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b) {
    parent[find(parent, a)] = find(parent, b);
}

// ---- edges ----

static size_t end_of_edge(const struct side *sides, size_t start, size_t count) {
    size_t end = start + 1;
    while (end < count && sides[end].low == sides[start].low &&
           sides[end].high == sides[start].high)
        end++;
    return end;
}

static uint32_t corner_of(const struct mesh *mesh, uint32_t triangle, uint32_t vertex) {
    uint32_t corner = 3 * triangle;
    while (mesh->triangles[corner] != vertex)
        corner++;
    return corner;
}

// Corners of two triangles at the ends of an edge that they share belong to one fan.
static void join_fans(const struct mesh *mesh, uint32_t *fans, const struct side *a,
                      const struct side *b) {
    join(fans, corner_of(mesh, a->triangle, a->low), corner_of(mesh, b->triangle, a->low));
    join(fans, corner_of(mesh, a->triangle, a->high), corner_of(mesh, b->triangle, a->high));
}

static uint32_t count_edges(const struct mesh *mesh, uint32_t *fans, struct topology *out) {
    size_t count = 3 * (size_t)mesh->triangle_count;
    struct side *sides = sorted_sides(mesh);
    uint32_t edges = 0;
    for (size_t i = 0, end; i < count; i = end, edges++) {
        end = end_of_edge(sides, i, count);
        out->open_edges += end - i == 1;
        out->non_manifold_edges += end - i > 2;
        out->flipped_edges += end - i == 2 && sides[i].forward == sides[i + 1].forward;
        for (size_t k = i + 1; k < end; k++)
            join_fans(mesh, fans, &sides[i], &sides[k]);
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
        uint32_t vertex = mesh->triangles[corner], fan = find(fans, corner);
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
    uint32_t *parent = singletons(mesh->vertex_count);
    uint32_t components = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        join(parent, mesh->triangles[3 * t], mesh->triangles[3 * t + 1]);
        join(parent, mesh->triangles[3 * t], mesh->triangles[3 * t + 2]);
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        components += parent[v] == v;
    free(parent);
    return components - unused_vertices;
}

struct topology topology_of(const struct mesh *mesh) {
    CHECK(mesh->triangle_count < UINT32_MAX / 3);
    struct topology out = {0};
    uint32_t *fans = singletons(3 * mesh->triangle_count);
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
