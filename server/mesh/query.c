#include "mesh/query.h"

#include "base/check.h"
#define WIDE 4
#include "mesh/query_search.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

struct query {
    const struct mesh *mesh;
    struct cluster_tree tree;
    double reach; // largest coordinate: what single precision is relative to
};

// ---- building ----

static double largest_coordinate(const struct mesh *mesh) {
    float largest = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        largest = fmaxf(largest, fabsf(mesh->positions[i]));
    return (double)largest;
}

enum result query_create(const struct mesh *mesh, struct query **out_query, struct error *err) {
    if (!mesh->triangle_count)
        return fail(err, RESULT_INVALID, "a surface without triangles");
    struct query *query = alloc(1, sizeof *query);
    query->mesh = mesh;
    query->reach = largest_coordinate(mesh);
    cluster_tree_init(&query->tree, mesh);
    *out_query = query;
    return RESULT_OK;
}

void query_destroy(struct query **query) {
    if (!*query)
        return;
    cluster_tree_fini(&(*query)->tree);
    free(*query);
    *query = NULL;
}

// ---- asking ----

#define FAR_MM 1e9 // from there single precision tells no two triangles apart, and then overflows

static bool is_better(const struct nearest_search *s, const struct closest *c) {
    if (!s->found)
        return c->distance <= s->limit;
    if (c->distance != s->best.distance)
        return c->distance < s->best.distance;
    return c->triangle < s->best.triangle;
}

void nearest_limit(struct nearest_search *s, double limit) {
    double near = limit + s->margin;
    s->limit = limit;
    s->square = (float)(near * near * (1 + 8 * (double)FLT_EPSILON));
}

void nearest_try(struct nearest_search *s, uint32_t triangle) {
    struct closest c;
    if (s->found && triangle == s->best.triangle)
        return;
    closest_on_triangle(s->mesh, triangle, s->p, &c);
    if (!is_better(s, &c))
        return;
    s->best = c;
    s->found = true;
    nearest_limit(s, c.distance);
}

void nearest_search_plain(struct nearest_search *s) {
    search_tree(s);
}

#if defined(__x86_64__)

static void search(struct nearest_search *s) {
    (__builtin_cpu_supports("avx2") ? nearest_search_avx2 : nearest_search_plain)(s);
}

#else

static void search(struct nearest_search *s) {
    nearest_search_plain(s);
}

#endif

static void search_all(struct nearest_search *s) {
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        nearest_try(s, t);
}

bool query_closest(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                   struct closest *out) {
    CHECK(vec3_is_finite(p));
    double farthest = fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z)));
    bool far = farthest > FAR_MM;
    if (far && max_distance < farthest - query->reach)
        return false;
    struct nearest_search s = {
        .mesh = query->mesh,
        .tree = &query->tree,
        .p = p,
        .p_single = {(float)p.x, (float)p.y, (float)p.z},
        .margin = 16 * (double)FLT_EPSILON * (query->reach + farthest),
    };
    nearest_limit(&s, max_distance);
    if (hint < query->mesh->triangle_count)
        nearest_try(&s, hint);
    (far ? search_all : search)(&s);
    if (s.found)
        *out = s.best;
    return s.found;
}
