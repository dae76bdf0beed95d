#include "cutting/surface.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

static void snapshot_init(struct snapshot *out, uint32_t vertex_bound, uint32_t triangle_bound) {
    *out = (struct snapshot){.vertex_bound = vertex_bound, .triangle_bound = triangle_bound};
    out->vertex_alive = alloc(vertex_bound, sizeof *out->vertex_alive);
    out->vertices = alloc(vertex_bound, sizeof *out->vertices);
    out->triangles = alloc(triangle_bound, 3 * sizeof *out->triangles);
    out->labels = alloc(triangle_bound, sizeof *out->labels);
    memset(out->triangles, 0xff, 3 * (size_t)triangle_bound * sizeof *out->triangles);
}

void snapshot_fini(struct snapshot *surface) {
    free(surface->vertex_alive);
    free(surface->vertices);
    free(surface->triangles);
    free(surface->labels);
    *surface = (struct snapshot){0};
}

void snapshot_of_cut(const struct cut_mesh *mesh, struct snapshot *out) {
    snapshot_init(out, cut_mesh_vertex_bound(mesh), cut_mesh_triangle_bound(mesh));
    for (uint32_t v = 0; v < out->vertex_bound; v++) {
        if (!cut_mesh_vertex_alive(mesh, v))
            continue;
        out->vertex_alive[v] = true;
        out->vertices[v] = cut_mesh_vertex(mesh, v);
        out->vertex_count++;
    }
    for (uint32_t t = 0; t < out->triangle_bound; t++) {
        if (!cut_mesh_triangle_alive(mesh, t))
            continue;
        memcpy(out->triangles + 3 * (size_t)t, cut_mesh_triangle(mesh, t), 3 * sizeof(uint32_t));
        out->labels[t] = cut_mesh_label(mesh, t);
        out->triangle_count++;
    }
}

void snapshot_of_mesh(const struct mesh *mesh, struct snapshot *out) {
    snapshot_init(out, mesh->vertex_count, mesh->triangle_count);
    out->vertex_count = mesh->vertex_count;
    out->triangle_count = mesh->triangle_count;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        out->vertex_alive[v] = true;
        out->vertices[v] = mesh_vertex(mesh, v);
    }
    memcpy(out->triangles, mesh->triangles, 3 * (size_t)mesh->triangle_count * sizeof(uint32_t));
}

bool snapshot_equals(const struct snapshot *a, const struct snapshot *b) {
    size_t vertices = a->vertex_bound, triangles = a->triangle_bound;
    return a->vertex_bound == b->vertex_bound && a->triangle_bound == b->triangle_bound &&
           !memcmp(a->vertex_alive, b->vertex_alive, vertices) &&
           !memcmp(a->vertices, b->vertices, vertices * sizeof *a->vertices) &&
           !memcmp(a->triangles, b->triangles, 3 * triangles * sizeof *a->triangles) &&
           !memcmp(a->labels, b->labels, triangles * sizeof *a->labels);
}

void snapshot_corners(const struct snapshot *surface, uint32_t triangle, vec3 out_corners[3]) {
    for (int i = 0; i < 3; i++)
        out_corners[i] = surface->vertices[surface->triangles[3 * (size_t)triangle + (size_t)i]];
}

static double volume_below(const struct snapshot *surface, uint32_t triangle, vec3 origin) {
    vec3 c[3];
    snapshot_corners(surface, triangle, c);
    for (int i = 0; i < 3; i++)
        c[i] = vec3_sub(c[i], origin);
    return vec3_dot(c[0], vec3_cross(c[1], c[2])) / 6;
}

// Near the mesh, so that little cancels.
static vec3 origin_of(const struct snapshot *surface) {
    for (uint32_t v = 0; v < surface->vertex_bound; v++)
        if (surface->vertex_alive[v])
            return surface->vertices[v];
    return (vec3){0};
}

double snapshot_volume(const struct snapshot *surface) {
    vec3 origin = origin_of(surface);
    double sum = 0;
    for (uint32_t t = 0; t < surface->triangle_bound; t++)
        if (snapshot_has(surface, t))
            sum += volume_below(surface, t, origin);
    return sum;
}

// ---- half-edges ---------------------------------------------------------------------------------
//
// Half-edge h runs from corner h % 3 of triangle h / 3 to the next corner. Those that leave a
// vertex are a list: first, next.

struct links {
    uint32_t *first, *next, *mate;
    uint32_t *valence; // half-edges that leave a vertex
};

static uint32_t following(uint32_t h) {
    return h % 3 == 2 ? h - 2 : h + 1;
}

static uint32_t target(const struct snapshot *surface, uint32_t h) {
    return surface->triangles[following(h)];
}

static uint32_t *filled(uint32_t count) {
    uint32_t *all = alloc(count, sizeof *all);
    memset(all, 0xff, (size_t)count * sizeof *all);
    return all;
}

static void links_fini(struct links *links) {
    free(links->first);
    free(links->next);
    free(links->mate);
    free(links->valence);
}

static const char *corners_fault(const struct snapshot *surface) {
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        const uint32_t *v = surface->triangles + 3 * (size_t)t;
        if (v[0] == MESH_NONE)
            continue;
        for (int i = 0; i < 3; i++)
            if (v[i] >= surface->vertex_bound || !surface->vertex_alive[v[i]])
                return "a triangle's corner is not alive";
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0])
            return "a triangle has a corner twice";
    }
    for (uint32_t v = 0; v < surface->vertex_bound; v++)
        if (surface->vertex_alive[v] && !vec3_is_finite(surface->vertices[v]))
            return "a vertex is not finite";
    return NULL;
}

static void link_up(const struct snapshot *surface, struct links *out) {
    uint32_t count = 3 * surface->triangle_bound;
    *out = (struct links){filled(surface->vertex_bound), filled(count), filled(count),
                          alloc(surface->vertex_bound, sizeof *out->valence)};
    for (uint32_t h = 0; h < count; h++) {
        uint32_t v = surface->triangles[h];
        if (v == MESH_NONE)
            continue;
        out->next[h] = out->first[v];
        out->first[v] = h;
        out->valence[v]++;
    }
}

static const char *pair_up(const struct snapshot *surface, struct links *links) {
    for (uint32_t h = 0; h < 3 * surface->triangle_bound; h++) {
        uint32_t from = surface->triangles[h];
        if (from == MESH_NONE)
            continue;
        uint32_t to = target(surface, h);
        for (uint32_t g = links->first[from]; g != MESH_NONE; g = links->next[g])
            if (g != h && target(surface, g) == to)
                return "two triangles run along an edge in the same direction";
        for (uint32_t g = links->first[to]; g != MESH_NONE; g = links->next[g])
            if (target(surface, g) == from)
                links->mate[h] = g;
        if (links->mate[h] == MESH_NONE)
            return "an edge has no other side";
    }
    return NULL;
}

static const char *fans_fault(const struct snapshot *surface, const struct links *links) {
    for (uint32_t v = 0; v < surface->vertex_bound; v++) {
        uint32_t start = links->first[v], h = start, steps = 0;
        if (!surface->vertex_alive[v])
            continue;
        if (start == MESH_NONE)
            return "a living vertex is in no triangle";
        do {
            h = links->mate[following(following(h))];
            steps++;
        } while (h != start && steps <= links->valence[v]);
        if (steps != links->valence[v])
            return "sheets touch in a vertex";
    }
    return NULL;
}

static void mark_part(const struct snapshot *surface, const struct links *links, uint32_t seed,
                      bool *seen, uint32_t *stack, double *out_volume) {
    vec3 origin = surface->vertices[surface->triangles[3 * (size_t)seed]];
    uint32_t *top = stack;
    *out_volume = 0;
    seen[seed] = true;
    for (*top++ = seed; top != stack;) {
        uint32_t t = *--top;
        *out_volume += volume_below(surface, t, origin);
        for (uint32_t h = 3 * t; h < 3 * t + 3; h++) {
            uint32_t other = links->mate[h] / 3;
            if (!seen[other])
                *top++ = other;
            seen[other] = true;
        }
    }
}

static int count_bodies(const struct snapshot *surface, const struct links *links) {
    bool *seen = alloc(surface->triangle_bound, sizeof *seen);
    uint32_t *stack = alloc(surface->triangle_bound, sizeof *stack);
    int bodies = 0;
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        double volume = 0;
        if (!seen[t] && snapshot_has(surface, t))
            mark_part(surface, links, t, seen, stack, &volume);
        bodies += volume > 0;
    }
    free(stack);
    free(seen);
    return bodies;
}

const char *snapshot_fault(const struct snapshot *surface, int *out_bodies) {
    struct links links;
    const char *fault = corners_fault(surface);
    if (fault)
        return fault;
    link_up(surface, &links);
    fault = pair_up(surface, &links);
    if (!fault)
        fault = fans_fault(surface, &links);
    if (!fault && out_bodies)
        *out_bodies = count_bodies(surface, &links);
    links_fini(&links);
    return fault;
}
