#include "generate/maxcut_polish.h"

#include "base/check.h"
#include "mesh/fold.h"
#include "generate/maxcut.h"

#include <stdlib.h>

static const int rounds = 16;

struct polish {
    const struct solid *tissue;
    struct mesh *least;
    bool *folded;   // triangles
    bool *restless; // vertices of triangles that are folded or stick out
    vec3 *sums;     // of a vertex's neighbours, or of its moves
    uint32_t *counts;
    uint32_t hint;
};

static bool has_moved(const struct polish *p, uint32_t v) {
    return vec3_distance(mesh_vertex(p->least, v), mesh_vertex(p->tissue->mesh, v)) > 1e-4;
}

// The way in from a sample that sticks out; false where it does not.
static bool sticks_out(struct polish *p, vec3 sample, vec3 *out_way) {
    double distance = solid_distance(p->tissue, sample, &p->hint);
    struct closest closest;
    if (distance <= MAXCUT_TOLERANCE_MM / 2 ||
        !query_closest(p->tissue->query, sample, INFINITY, p->hint, &closest))
        return false;
    *out_way = vec3_scale((distance + MAXCUT_INSET_MM) / distance, vec3_sub(closest.point, sample));
    return true;
}

static void add_move(struct polish *p, uint32_t vertex, vec3 move) {
    p->sums[vertex] = vec3_add(p->sums[vertex], move);
    p->counts[vertex]++;
}

// Every corner of a triangle goes the way in from those of its samples that stick out.
static bool draw_in(struct polish *p) {
    bool any = false;
    for (uint32_t v = 0; v < p->least->vertex_count; v++) {
        p->sums[v] = (vec3){0};
        p->counts[v] = 0;
    }
    for (uint32_t t = 0; t < p->least->triangle_count; t++) {
        const uint32_t *c = p->least->triangles + 3 * (size_t)t;
        if (!has_moved(p, c[0]) && !has_moved(p, c[1]) && !has_moved(p, c[2]))
            continue;
        for (int i = 0; i < MAXCUT_SAMPLES; i++) {
            vec3 way;
            if (!sticks_out(p, maxcut_sample(p->least, t, i), &way))
                continue;
            for (int k = 0; k < 3; k++)
                add_move(p, c[k], way);
        }
    }
    for (uint32_t v = 0; v < p->least->vertex_count; v++) {
        if (!p->counts[v] || !has_moved(p, v))
            continue;
        vec3 at = mesh_vertex(p->least, v);
        mesh_set_vertex(p->least, v, vec3_add_scaled(at, 1.0 / p->counts[v], p->sums[v]));
        any = p->restless[v] = true;
    }
    return any;
}

static void gather_neighbours(struct polish *p) {
    for (uint32_t v = 0; v < p->least->vertex_count; v++) {
        p->sums[v] = (vec3){0};
        p->counts[v] = 0;
    }
    for (size_t i = 0; i < 3 * (size_t)p->least->triangle_count; i++) {
        size_t next = i % 3 == 2 ? i - 2 : i + 1;
        add_move(p, p->least->triangles[i], mesh_vertex(p->least, p->least->triangles[next]));
    }
}

// Vertices of folded triangles go to the middle of their neighbours.
static bool unfold(struct polish *p) {
    bool any = false;
    folds_of(p->least, p->folded);
    for (uint32_t v = 0; v < p->least->vertex_count; v++)
        p->restless[v] = false;
    for (uint32_t t = 0; t < p->least->triangle_count; t++)
        for (int i = 0; p->folded[t] && i < 3; i++) {
            uint32_t v = p->least->triangles[3 * (size_t)t + (size_t)i];
            p->restless[v] = has_moved(p, v);
            any |= p->restless[v];
        }
    if (!any)
        return false;
    gather_neighbours(p);
    for (uint32_t v = 0; v < p->least->vertex_count; v++)
        if (p->restless[v])
            mesh_set_vertex(p->least, v, vec3_scale(1.0 / p->counts[v], p->sums[v]));
    return true;
}

bool maxcut_polish(const struct solid *tissue, struct mesh *least, bool *out_restless) {
    struct polish p = {.tissue = tissue, .least = least, .restless = out_restless};
    p.hint = MESH_NONE;
    p.folded = alloc(least->triangle_count, sizeof *p.folded);
    p.sums = alloc(least->vertex_count, sizeof *p.sums);
    p.counts = alloc(least->vertex_count, sizeof *p.counts);
    bool unfit = true;
    for (int round = 0; unfit && round < rounds; round++) {
        unfit = unfold(&p);
        unfit |= draw_in(&p);
    }
    free(p.folded);
    free(p.sums);
    free(p.counts);
    return !unfit;
}
