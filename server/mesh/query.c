#include "mesh/query.h"

#include "base/check.h"
#define WIDE 4
#define WIDE_TARGET
#include "mesh/query_search.h"

#include <float.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

struct query {
    const struct mesh *mesh;
    struct cluster_tree tree;
    double reach; // largest coordinate: what single precision is relative to
    uint64_t id;  // that no other query of the process has had
};

// ---- building ----

static double largest_coordinate(const struct mesh *mesh) {
    float largest = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        largest = fmaxf(largest, fabsf(mesh->positions[i]));
    return (double)largest;
}

enum result query_create(const struct mesh *mesh, struct query **out_query, struct error *err) {
    static _Atomic uint64_t last_id;
    if (!mesh->triangle_count)
        return fail(err, RESULT_INVALID, "a surface without triangles");
    struct query *query = alloc(1, sizeof *query);
    query->mesh = mesh;
    query->reach = largest_coordinate(mesh);
    query->id = ++last_id;
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

#define NEAR_MM 0.5 // how far beyond the answer a search looks, for the next ones
#define FAR_MM 1e9  // from there single precision tells no two triangles apart, and then overflows

static bool is_better(const struct nearest_search *s, const struct closest *c) {
    if (!s->found)
        return c->distance <= s->limit;
    if (c->distance != s->best.distance)
        return c->distance < s->best.distance;
    return c->triangle < s->best.triangle;
}

static float square_of(double distance) {
    return (float)(distance * distance * (1 + 8 * (double)FLT_EPSILON));
}

void nearest_limit(struct nearest_search *s, double limit) {
    s->limit = limit;
    s->square = square_of(limit + s->margin);
    if (s->near)
        s->near_square = square_of(limit + s->margin + NEAR_MM);
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

// A true distance, at least, by its square in single precision.
static double distance_above(const struct nearest_search *s, float square) {
    return sqrt((double)square) * (1 - 8 * (double)FLT_EPSILON) - s->margin;
}

void nearest_pass(struct nearest_search *s, float square) {
    s->near->clear = fmin(s->near->clear, distance_above(s, square));
}

void nearest_keep(struct nearest_search *s, uint32_t cluster, float square) {
    struct query_near *near = s->near;
    float away = nextafterf((float)distance_above(s, square), -INFINITY);
    uint32_t at = near->count < QUERY_NEAR_MAX ? near->count++ : QUERY_NEAR_MAX;
    if (at == QUERY_NEAR_MAX) {
        at--;
        near->clear = fmin(near->clear, (double)fmaxf(away, near->away[at]));
        if (away >= near->away[at])
            return;
    }
    for (; at > 0 && near->away[at - 1] > away; at--) {
        near->away[at] = near->away[at - 1];
        near->clusters[at] = near->clusters[at - 1];
    }
    near->away[at] = away;
    near->clusters[at] = cluster;
}

void nearest_search_plain(struct nearest_search *s) {
    search_tree(s);
}

void nearest_look_plain(struct nearest_search *s) {
    look_near(s);
}

#if defined(__x86_64__)

static void search(struct nearest_search *s) {
    (__builtin_cpu_supports("avx2") ? nearest_search_avx2 : nearest_search_plain)(s);
}

static void look(struct nearest_search *s) {
    (__builtin_cpu_supports("avx2") ? nearest_look_avx2 : nearest_look_plain)(s);
}

#else

static void search(struct nearest_search *s) {
    nearest_search_plain(s);
}

static void look(struct nearest_search *s) {
    nearest_look_plain(s);
}

#endif

static void search_all(struct nearest_search *s) {
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        nearest_try(s, t);
}

// Whether what the last search told is enough: what it passed by is farther than clear − moved.
static bool knows(struct nearest_search *s, struct query_near *near) {
    if (!(s->moved < near->clear))
        return false;
    s->near = near;
    look(s);
    return s->limit < near->clear - s->moved;
}

static bool is_far_from_all(const struct nearest_search *s, const struct query_near *near) {
    return s->limit < near->clear - s->moved &&
           (!near->count || s->limit < (double)near->away[0] - s->moved);
}

// Fills *near where the next places will be near, too.
static void search_anew(struct nearest_search *s, uint64_t query, struct query_near *near) {
    bool is_slow = s->moved < 2 * NEAR_MM;
    *near = (struct query_near){.query = query, .from = s->p, .clear = is_slow ? INFINITY : 0};
    s->near = is_slow ? near : NULL;
    nearest_limit(s, s->limit);
    search(s);
}

static bool ask(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                struct query_near *near, struct closest *out) {
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
        .moved = INFINITY,
    };
    if (near && near->query == query->id)
        s.moved = vec3_distance(p, near->from);
    nearest_limit(&s, max_distance);
    if (near && is_far_from_all(&s, near))
        return false;
    if (hint < query->mesh->triangle_count)
        nearest_try(&s, hint);
    if (far)
        search_all(&s);
    else if (!near)
        search(&s);
    else if (!knows(&s, near))
        search_anew(&s, query->id, near);
    if (s.found)
        *out = s.best;
    return s.found;
}

bool query_closest(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                   struct closest *out) {
    return ask(query, p, max_distance, hint, NULL, out);
}

bool query_closest_near(const struct query *query, vec3 p, double max_distance, uint32_t hint,
                        struct query_near *near, struct closest *out) {
    return ask(query, p, max_distance, hint, near, out);
}
