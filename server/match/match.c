#include "match/match.h"

#include "base/check.h"
#include "match/cubic.h"
#include "match/surface.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

// A vertex reaches s_i = 1 at this s.
struct bound {
    double s;
    uint32_t vertex;
};

struct match {
    const struct match_surface *surface;
    double *blends;  // s_i
    vec3 *positions; // S''
    double volume;   // inside S''

    // of the call that runs
    vec3 origin;       // volumes are summed about it
    double *distances; // from the brushes, squared, in their radii
    double *falloffs;  // b_i; 0 for all vertices that are not touched
    vec3 *velocities;  // of S'' over s: b_i (S'_max,i − S'_i), 0 once s_i = 1
    uint32_t *touched; // ascending
    uint32_t touched_count;
    struct bound *bounds; // a heap, the lowest s first
    uint32_t bound_count;
};

struct match *match_create(const struct match_surface *surface) {
    struct match *match = alloc(1, sizeof *match);
    uint32_t count = surface->vertex_count;
    match->surface = surface;
    match->blends = alloc(count, sizeof *match->blends);
    match->positions = alloc(count, sizeof *match->positions);
    match->distances = alloc(count, sizeof *match->distances);
    match->falloffs = alloc(count, sizeof *match->falloffs);
    match->velocities = alloc(count, sizeof *match->velocities);
    match->touched = alloc(count, sizeof *match->touched);
    match->bounds = alloc(count, sizeof *match->bounds);
    memcpy(match->positions, surface->start, count * sizeof *match->positions);
    match->volume = surface->volume;
    return match;
}

struct match *match_copy(const struct match *match) {
    struct match *copy = match_create(match->surface);
    uint32_t count = match->surface->vertex_count;
    memcpy(copy->blends, match->blends, count * sizeof *copy->blends);
    memcpy(copy->positions, match->positions, count * sizeof *copy->positions);
    copy->volume = match->volume;
    return copy;
}

void match_destroy(struct match **match) {
    if (!*match)
        return;
    free((*match)->blends);
    free((*match)->positions);
    free((*match)->distances);
    free((*match)->falloffs);
    free((*match)->velocities);
    free((*match)->touched);
    free((*match)->bounds);
    free(*match);
    *match = NULL;
}

const double *match_blends(const struct match *match) {
    return match->blends;
}

double match_volume(const struct match *match) {
    return surface_volume(match->surface, match->positions);
}

vec3 match_surface_vertex(const struct match_surface *surface, uint32_t vertex) {
    CHECK(vertex < surface->vertex_count);
    return surface->start[vertex];
}

vec3 match_vertex(const struct match *match, uint32_t vertex) {
    CHECK(vertex < match->surface->vertex_count);
    return match->positions[vertex];
}

// ---- brushes ------------------------------------------------------------------------------------

#define WIDENING_STEP 1.5

// Of p from the segment between S'' and S'_max, squared.
static double distance_from_way(const struct match *match, uint32_t vertex, vec3 p) {
    vec3 way = match->surface->way[vertex], apart = vec3_sub(match->positions[vertex], p);
    double along = -vec3_dot(apart, way) / vec3_dot(way, way);
    along = fmax(0, fmin(along, 1 - match->blends[vertex]));
    apart = vec3_add_scaled(apart, along, way);
    return vec3_dot(apart, apart);
}

static bool may_move(const struct match *match, uint32_t vertex) {
    vec3 way = match->surface->way[vertex];
    return match->blends[vertex] < 1 && vec3_dot(way, way) > 0;
}

static void measure_distances(struct match *match, const struct brush *brushes, int count) {
    for (uint32_t v = 0; v < match->surface->vertex_count; v++)
        match->distances[v] = INFINITY;
    for (int i = 0; i < count; i++) {
        double radius = fmax(brushes[i].radius, match->surface->spacing);
        double scale = 1 / (radius * radius);
        for (uint32_t v = 0; v < match->surface->vertex_count; v++)
            if (may_move(match, v)) {
                double distance = scale * distance_from_way(match, v, brushes[i].centre);
                match->distances[v] = fmin(match->distances[v], distance);
            }
    }
}

static double falloff(double distance) {
    static const double end = 0.13533528323661270; // exp(−2)
    return distance < 1 ? 2 * (exp(-2 * distance) - end) / (1 - end) : 0;
}

static void put_brushes(struct match *match, double widening) {
    for (uint32_t v = 0; v < match->surface->vertex_count; v++) {
        double b = falloff(match->distances[v] / (widening * widening));
        if (!(b > 0))
            continue;
        match->touched[match->touched_count++] = v;
        match->falloffs[v] = b;
        match->velocities[v] = vec3_scale(b, match->surface->way[v]);
    }
}

static double bound_of(const struct match *match, uint32_t vertex) {
    return (1 - match->blends[vertex]) / match->falloffs[vertex];
}

static double blend_at(const struct match *match, uint32_t vertex, double s) {
    double blend = match->blends[vertex] + s * match->falloffs[vertex];
    return s < bound_of(match, vertex) ? fmin(blend, 1) : 1;
}

// Leaves the blends at s, and of the touched vertices those whose blend changed.
static void take_brushes(struct match *match, double s) {
    uint32_t count = match->touched_count;
    match->touched_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = match->touched[i];
        double blend = blend_at(match, v, s);
        if (blend != match->blends[v])
            match->touched[match->touched_count++] = v;
        match->blends[v] = blend;
        match->positions[v] =
            vec3_add_scaled(match->surface->start[v], blend, match->surface->way[v]);
        match->falloffs[v] = 0;
        match->velocities[v] = (vec3){0};
    }
}

// ---- the vertices in the order in which they reach their bound ----------------------------------

static bool is_before(struct bound a, struct bound b) {
    return a.s < b.s || (a.s == b.s && a.vertex < b.vertex);
}

static void sink(struct match *match, uint32_t at) {
    struct bound *heap = match->bounds, item = heap[at];
    for (uint32_t child; (child = 2 * at + 1) < match->bound_count; at = child) {
        if (child + 1 < match->bound_count && is_before(heap[child + 1], heap[child]))
            child++;
        if (!is_before(heap[child], item))
            break;
        heap[at] = heap[child];
    }
    heap[at] = item;
}

static void gather_bounds(struct match *match) {
    match->bound_count = 0;
    for (uint32_t i = 0; i < match->touched_count; i++) {
        struct bound bound = {bound_of(match, match->touched[i]), match->touched[i]};
        if (bound.s < 1)
            match->bounds[match->bound_count++] = bound;
    }
    for (uint32_t i = match->bound_count / 2; i-- > 0;)
        sink(match, i);
}

static struct bound take_bound(struct match *match) {
    struct bound lowest = match->bounds[0];
    match->bounds[0] = match->bounds[--match->bound_count];
    sink(match, 0);
    return lowest;
}

// ---- the volume over s --------------------------------------------------------------------------

// A corner of a triangle at s: at + s velocity.
struct moving_corner {
    vec3 at, velocity;
};

static struct moving_corner corner_of(const struct match *match, uint32_t vertex) {
    return (struct moving_corner){vec3_sub(match->positions[vertex], match->origin),
                                  match->velocities[vertex]};
}

// Six times the volume under a triangle, v · (a × b), but for what does not depend on s.
static void add_triangle(struct cubic *sum, struct moving_corner v, struct moving_corner a,
                         struct moving_corner b) {
    vec3 still = vec3_cross(a.at, b.at), fast = vec3_cross(a.velocity, b.velocity);
    vec3 mixed = vec3_add(vec3_cross(a.velocity, b.at), vec3_cross(a.at, b.velocity));
    sum->c[1] += vec3_dot(v.velocity, still) + vec3_dot(v.at, mixed);
    sum->c[2] += vec3_dot(v.velocity, mixed) + vec3_dot(v.at, fast);
    sum->c[3] += vec3_dot(v.velocity, fast);
}

static bool is_touched_before(const struct match *match, uint32_t vertex, uint32_t other) {
    return vertex < other && match->falloffs[vertex] > 0;
}

// 6 (V(s) − target) up to the first bound: every touched triangle once, from its first touched
// corner.
static struct cubic sum_volumes(const struct match *match, double target) {
    const struct match_surface *surface = match->surface;
    struct cubic sum = {{6 * (match->volume - target)}};
    for (uint32_t i = 0; i < match->touched_count; i++) {
        uint32_t v = match->touched[i];
        struct moving_corner corner = corner_of(match, v);
        for (uint32_t k = surface->first[v]; k < surface->first[v + 1]; k++) {
            struct opposite side = surface->opposites[k];
            if (!is_touched_before(match, side.from, v) && !is_touched_before(match, side.to, v))
                add_triangle(&sum, corner, corner_of(match, side.from), corner_of(match, side.to));
        }
    }
    return sum;
}

// A vertex stands still from its bound s_b on. Its fan encloses x · N(s) about the origin,
// N = Σ a × b; the polynomial changes by (s_b − s) velocity · N(s), which is 0 at the bound.
static void stop_at(struct match *match, struct bound bound, struct cubic *sum) {
    const struct match_surface *surface = match->surface;
    uint32_t vertex = bound.vertex;
    vec3 N[3] = {0};
    for (uint32_t k = surface->first[vertex]; k < surface->first[vertex + 1]; k++) {
        struct moving_corner a = corner_of(match, surface->opposites[k].from);
        struct moving_corner b = corner_of(match, surface->opposites[k].to);
        N[0] = vec3_add(N[0], vec3_cross(a.at, b.at));
        N[1] = vec3_add(N[1], vec3_cross(a.velocity, b.at));
        N[1] = vec3_add(N[1], vec3_cross(a.at, b.velocity));
        N[2] = vec3_add(N[2], vec3_cross(a.velocity, b.velocity));
    }
    for (int i = 0; i < 3; i++) {
        double gain = vec3_dot(match->velocities[vertex], N[i]);
        sum->c[i] += bound.s * gain;
        sum->c[i + 1] -= gain;
    }
    match->velocities[vertex] = (vec3){0};
    match->positions[vertex] = vec3_add(surface->start[vertex], surface->way[vertex]);
}

// ---- matching -----------------------------------------------------------------------------------

// Where the volume reaches the target, or is least.
struct solution {
    bool reached;
    double s, left; // left: volume − target
    int steps;
};

// Between one bound and the next the volume is one cubic: the first one that reaches the target.
static struct solution sweep(struct match *match, double target) {
    double rounding = 4 * DBL_EPSILON * match->surface->volume;
    gather_bounds(match);
    struct cubic p = sum_volumes(match, target);
    struct solution best = {.left = p.c[0]};
    for (double from = 0, to; !best.reached && from < 1; from = to) {
        double s;
        to = match->bound_count ? match->bounds[0].s : 1;
        best.reached = cubic_descend(&p, from, to, 6 * rounding, &s, &best.steps);
        double left = cubic_at(&p, s);
        if (best.reached || left < best.left) {
            best.s = s;
            best.left = left;
        }
        if (!best.reached && match->bound_count)
            stop_at(match, take_bound(match), &p);
    }
    best.left /= 6;
    return best;
}

void match_to_volume(struct match *match, const struct brush *brushes, int brush_count,
                     double target_mm3, struct match_report *out_report) {
    CHECK(isfinite(target_mm3));
    struct match_report *out = out_report;
    *out = (struct match_report){.volume_mm3 = match->volume,
                                 .widening = 1,
                                 .left_mm3 = match->volume - target_mm3,
                                 .changed = match->touched};
    match->touched_count = 0;
    if (target_mm3 >= match->volume)
        return;
    match->origin = brush_count ? brushes[0].centre : (vec3){0};
    measure_distances(match, brushes, brush_count);
    struct solution solution;
    for (double widening = 1;; widening = fmin(WIDENING_STEP * widening, MATCH_WIDENING_MAX)) {
        put_brushes(match, widening);
        solution = sweep(match, target_mm3);
        out->steps += solution.steps;
        out->widening = widening;
        if (solution.reached || widening >= MATCH_WIDENING_MAX)
            break;
        take_brushes(match, 0);
    }
    take_brushes(match, solution.s);
    match->volume = target_mm3 + solution.left;
    out->outcome = solution.reached ? MATCH_REACHED : MATCH_SATURATED;
    out->volume_mm3 = match->volume;
    out->left_mm3 = solution.left;
    out->scale = solution.s;
    out->changed_count = match->touched_count;
}
