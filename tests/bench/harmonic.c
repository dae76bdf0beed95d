#include "harmonic.h"

#include "base/check.h"

#include <stdlib.h>

#define SHIFT_MM 0.1371 // no vertex of a made mesh on a grid line
#define SIDE_SLACK 1e-9 // of a triangle, so that no line slips between two
#define SHARE_LEAST 1e-6
#define TOLERANCE 1e-9
#define STEPS_MAX 2000

// ---- where grid edges meet surfaces -------------------------------------------------------------

// The crossings of one edge that are nearest to its lower and its upper end.
struct crossing {
    double at[2];  // from that end, a share of the edge
    bool front[2]; // that end sees the front
    vec3 value[2]; // Δ there
};

struct grid {
    const struct harmonic_setup *setup;
    int size[3];
    size_t node_count, step[3];
    vec3 origin;
    uint32_t *edges[3]; // of the edge from each node along each axis: its crossing, or NONE
    struct crossing *crossings;
    uint32_t crossing_count, crossing_capacity;
    uint8_t *is_within; // each node
};

static double component(vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

static vec3 node_place(const struct grid *g, size_t node) {
    size_t i = node % (size_t)g->size[0], j = node / g->step[1] % (size_t)g->size[1];
    vec3 steps = {(double)i, (double)j, (double)(node / g->step[2])};
    return vec3_add_scaled(g->origin, g->setup->spacing_mm, steps);
}

static double snap(double at, double spacing, int up) {
    return spacing * (floor((at - SHIFT_MM) / spacing) + up) + SHIFT_MM;
}

static bool is_within(const struct harmonic_setup *setup, vec3 p) {
    return !setup->is_within || setup->is_within(setup->context, p);
}

// The outermost nodes, which have the values of the solution around.
static bool is_last(const struct grid *g, size_t node) {
    for (int a = 0; a < 3; a++) {
        size_t at = node / g->step[a] % (size_t)g->size[a];
        if (at == 0 || at + 1 == (size_t)g->size[a])
            return true;
    }
    return false;
}

static void grid_init(struct grid *g, const struct harmonic_setup *setup) {
    double h = setup->spacing_mm;
    *g = (struct grid){.setup = setup};
    g->origin = (vec3){snap(setup->box.min.x, h, 0), snap(setup->box.min.y, h, 0),
                       snap(setup->box.min.z, h, 0)};
    g->node_count = 1;
    for (int a = 0; a < 3; a++) {
        double to = snap(component(setup->box.max, a), h, 1);
        g->size[a] = 1 + (int)lround((to - component(g->origin, a)) / h);
        g->step[a] = g->node_count;
        g->node_count *= (size_t)g->size[a];
    }
    CHECK(g->node_count < HARMONIC_NONE);
    g->is_within = alloc(g->node_count, 1);
    for (size_t n = 0; n < g->node_count; n++)
        g->is_within[n] = is_within(setup, node_place(g, n)) && !(setup->around && is_last(g, n));
    for (int a = 0; a < 3; a++) {
        g->edges[a] = alloc(g->node_count, sizeof(uint32_t));
        for (size_t n = 0; n < g->node_count; n++)
            g->edges[a][n] = HARMONIC_NONE;
    }
}

static void grid_fini(struct grid *g) {
    for (int a = 0; a < 3; a++)
        free(g->edges[a]);
    free(g->crossings);
    free(g->is_within);
}

static struct crossing *need_crossing(struct grid *g, int axis, size_t node) {
    uint32_t *edge = &g->edges[axis][node];
    if (*edge == HARMONIC_NONE) {
        if (g->crossing_count == g->crossing_capacity) {
            g->crossing_capacity = g->crossing_capacity ? 2 * g->crossing_capacity : 4096;
            g->crossings = alloc_resize(g->crossings, g->crossing_capacity, sizeof *g->crossings);
        }
        *edge = g->crossing_count++;
        g->crossings[*edge] = (struct crossing){.at = {INFINITY, INFINITY}};
    }
    return &g->crossings[*edge];
}

// A triangle in the world, each corner with its Δ.
struct facet {
    vec3 at[3], delta[3];
    bool hollow;
};

static vec3 weighed(const vec3 v[3], const double w[3]) {
    return vec3_add_scaled(vec3_add_scaled(vec3_scale(w[0], v[0]), w[1], v[1]), w[2], v[2]);
}

static void cross_edge(struct grid *g, const struct facet *facet, int axis, size_t line,
                       const double weights[3], bool faces_down) {
    double at = component(weighed(facet->at, weights), axis);
    double steps = (at - component(g->origin, axis)) / g->setup->spacing_mm;
    if (!(steps >= 0 && steps < g->size[axis] - 1))
        return;
    double below = floor(steps);
    struct crossing *c = need_crossing(g, axis, line + (size_t)below * g->step[axis]);
    for (int end = 0; end < 2; end++) {
        double share = end ? 1 - (steps - below) : steps - below;
        if (share >= c->at[end])
            continue;
        c->at[end] = share;
        c->front[end] = (faces_down != facet->hollow) == (end == 0);
        c->value[end] = weighed(facet->delta, weights);
    }
}

// The nodes of a row that lie between two heights: from, to (past the last).
static void range(const struct grid *g, const struct facet *f, int axis, int out[2]) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 3; i++) {
        double steps =
            (component(f->at[i], axis) - component(g->origin, axis)) / g->setup->spacing_mm;
        low = fmin(low, steps);
        high = fmax(high, steps);
    }
    out[0] = (int)fmin(fmax(ceil(low - SIDE_SLACK), 0), g->size[axis]);
    out[1] = (int)fmin(fmax(floor(high + SIDE_SLACK) + 1, 0), g->size[axis]);
}

// Twice the area of p a b as seen along an axis, b and c the other two in turn.
static double turn(const double p[2], vec3 a, vec3 b, int u, int v) {
    return (component(a, u) - p[0]) * (component(b, v) - p[1]) -
           (component(b, u) - p[0]) * (component(a, v) - p[1]);
}

static void cross_lines(struct grid *g, const struct facet *f, int axis) {
    int u = (axis + 1) % 3, v = (axis + 2) % 3, us[2], vs[2];
    const double corner[2] = {component(f->at[0], u), component(f->at[0], v)};
    double area = turn(corner, f->at[1], f->at[2], u, v);
    if (area == 0)
        return;
    range(g, f, u, us);
    range(g, f, v, vs);
    for (int j = vs[0]; j < vs[1]; j++)
        for (int i = us[0]; i < us[1]; i++) {
            double p[2] = {component(g->origin, u) + g->setup->spacing_mm * i,
                           component(g->origin, v) + g->setup->spacing_mm * j};
            double w[3];
            for (int k = 0; k < 3; k++)
                w[k] = turn(p, f->at[(k + 1) % 3], f->at[(k + 2) % 3], u, v) / area;
            if (fmin(w[0], fmin(w[1], w[2])) >= -SIDE_SLACK)
                cross_edge(g, f, axis, (size_t)i * g->step[u] + (size_t)j * g->step[v], w,
                           area < 0);
        }
}

static struct facet facet_of(const struct warp_scene *scene, int surface, uint32_t triangle) {
    const struct warp_surface *s = &scene->surfaces[surface];
    struct facet f;
    for (int i = 0; i < 3; i++) {
        struct closest corner = {.point = mesh_corner(s->mesh, triangle, i),
                                 .triangle = triangle,
                                 .weights = {i == 0, i == 1, i == 2},
                                 .feature = FEATURE_VERTEX,
                                 .corner = i};
        f.at[i] = pose_apply(scene->T_world_body[s->body], corner.point);
        f.delta[i] = warp_of_contact(scene, surface, &corner);
    }
    return f;
}

static void cross_surfaces(struct grid *g) {
    const struct warp_scene *scene = g->setup->scene;
    for (int k = 0; k < scene->surface_count; k++)
        for (uint32_t t = 0; t < scene->surfaces[k].mesh->triangle_count; t++) {
            struct facet facet = facet_of(scene, k, t);
            facet.hollow = g->setup->hollow >> k & 1;
            for (int axis = 0; axis < 3; axis++)
                cross_lines(g, &facet, axis);
        }
}

// ---- the space ----------------------------------------------------------------------------------

// What lies in direction d (0 to 5) of a node.
struct way {
    size_t node;                     // the next one, or
    const struct crossing *crossing; // NULL: none
    int end;                         // of it that the node is
    bool is_out;                     // past the far boundary
};

static struct way way_from(const struct grid *g, size_t node, int d) {
    int axis = d / 2, up = d % 2;
    size_t at = node / g->step[axis] % (size_t)g->size[axis];
    struct way way = {.end = !up, .is_out = at == (up ? (size_t)g->size[axis] - 1 : 0)};
    if (way.is_out)
        return way;
    way.node = up ? node + g->step[axis] : node - g->step[axis];
    uint32_t edge = g->edges[axis][up ? node : way.node];
    way.crossing = edge == HARMONIC_NONE ? NULL : &g->crossings[edge];
    way.is_out = !way.crossing && !g->is_within[way.node];
    return way;
}

struct region {
    size_t nodes, fronts, backs;
};

static struct region flood(const struct grid *g, size_t start, uint32_t id, uint32_t *regions,
                           size_t *stack) {
    struct region region = {0};
    size_t waiting = 0;
    regions[start] = id;
    stack[waiting++] = start;
    while (waiting) {
        size_t node = stack[--waiting];
        region.nodes++;
        for (int d = 0; d < 6; d++) {
            struct way way = way_from(g, node, d);
            if (way.crossing) {
                region.fronts += way.crossing->front[way.end];
                region.backs += !way.crossing->front[way.end];
            } else if (!way.is_out && regions[way.node] == HARMONIC_NONE) {
                regions[way.node] = id;
                stack[waiting++] = way.node;
            }
        }
    }
    return region;
}

static bool is_space(const struct region *region) {
    return region->fronts >= region->backs;
}

static void number_nodes(const struct grid *g, const uint32_t *regions,
                         const struct region *of_regions, struct harmonic *out) {
    size_t largest = 0;
    for (size_t n = 0; n < g->node_count; n++)
        if (regions[n] != HARMONIC_NONE && is_space(&of_regions[regions[n]]))
            largest =
                of_regions[regions[n]].nodes > largest ? of_regions[regions[n]].nodes : largest;
    out->index = alloc(g->node_count, sizeof(uint32_t));
    out->nodes = alloc(g->node_count, sizeof(uint32_t));
    for (size_t n = 0; n < g->node_count; n++) {
        const struct region *r = regions[n] == HARMONIC_NONE ? NULL : &of_regions[regions[n]];
        bool taken = r && is_space(r) && 10 * r->nodes >= largest;
        out->index[n] = taken ? out->count : HARMONIC_NONE;
        if (taken)
            out->nodes[out->count++] = (uint32_t)n;
    }
}

static void find_space(const struct grid *g, struct harmonic *out) {
    uint32_t *regions = alloc(g->node_count, sizeof *regions), count = 0;
    size_t *stack = alloc(g->node_count, sizeof *stack);
    struct region *of_regions = NULL;
    uint32_t capacity = 0;
    for (size_t n = 0; n < g->node_count; n++)
        regions[n] = HARMONIC_NONE;
    for (size_t n = 0; n < g->node_count; n++) {
        if (!g->is_within[n] || regions[n] != HARMONIC_NONE)
            continue;
        if (count == capacity) {
            capacity = capacity ? 2 * capacity : 64;
            of_regions = alloc_resize(of_regions, capacity, sizeof *of_regions);
        }
        of_regions[count] = flood(g, n, count, regions, stack);
        count++;
    }
    number_nodes(g, regions, of_regions, out);
    free(of_regions);
    free(stack);
    free(regions);
}

// ---- the equations ------------------------------------------------------------------------------

// A W = b with A symmetric: `diagonal`, and −1 for each neighbour.
struct equations {
    const struct harmonic *space;
    double *diagonal, *factor; // factor: of the incomplete Cholesky, 1/d
    vec3 *b;
    double largest; // of the values on boundaries
};

// Where it is not known nothing flows, but for as little as keeps the equations regular.
static void take_border(const struct grid *g, struct equations *e, uint32_t i, size_t node) {
    const struct harmonic_setup *setup = g->setup;
    vec3 place = node_place(g, node), value = {0};
    bool known =
        !setup->around || !is_within(setup, place) || harmonic_at(setup->around, place, &value);
    e->diagonal[i] += known ? 1 : SHARE_LEAST;
    e->b[i] = vec3_add(e->b[i], value);
    e->largest = fmax(e->largest, vec3_length(value));
}

static void set_row(const struct grid *g, struct harmonic *space, struct equations *e, uint32_t i) {
    for (int d = 0; d < 6; d++) {
        struct way way = way_from(g, space->nodes[i], d);
        space->neighbours[i][d] = HARMONIC_NONE;
        if (way.crossing) {
            double conductance = 1 / fmax(way.crossing->at[way.end], SHARE_LEAST);
            vec3 value = way.crossing->value[way.end];
            e->diagonal[i] += conductance;
            e->b[i] = vec3_add_scaled(e->b[i], conductance, value);
            e->largest = fmax(e->largest, vec3_length(value));
        } else if (way.is_out) {
            take_border(g, e, i, way.node);
        } else {
            e->diagonal[i] += 1;
            space->neighbours[i][d] = space->index[way.node];
        }
    }
}

static void set_factor(struct equations *e) {
    for (uint32_t i = 0; i < e->space->count; i++) {
        double d = e->diagonal[i];
        for (int k = 0; k < 6; k += 2) { // lower neighbours come first
            uint32_t j = e->space->neighbours[i][k];
            d -= j == HARMONIC_NONE ? 0 : e->factor[j];
        }
        e->factor[i] = 1 / d;
    }
}

static void multiply(const struct equations *e, const vec3 *x, vec3 *out) {
    for (uint32_t i = 0; i < e->space->count; i++) {
        vec3 sum = vec3_scale(e->diagonal[i], x[i]);
        for (int k = 0; k < 6; k++) {
            uint32_t j = e->space->neighbours[i][k];
            sum = j == HARMONIC_NONE ? sum : vec3_sub(sum, x[j]);
        }
        out[i] = sum;
    }
}

// (D − L) D⁻¹ (D − Lᵀ) z = r
static void precondition(const struct equations *e, const vec3 *r, vec3 *out) {
    for (uint32_t i = 0; i < e->space->count; i++) {
        vec3 sum = r[i];
        for (int k = 0; k < 6; k += 2) {
            uint32_t j = e->space->neighbours[i][k];
            sum = j == HARMONIC_NONE ? sum : vec3_add(sum, out[j]);
        }
        out[i] = vec3_scale(e->factor[i], sum);
    }
    for (uint32_t i = e->space->count; i-- > 0;) {
        vec3 sum = {0};
        for (int k = 1; k < 6; k += 2) {
            uint32_t j = e->space->neighbours[i][k];
            sum = j == HARMONIC_NONE ? sum : vec3_add(sum, out[j]);
        }
        out[i] = vec3_add_scaled(out[i], e->factor[i], sum);
    }
}

static double dot(const vec3 *a, const vec3 *b, uint32_t count) {
    double sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += vec3_dot(a[i], b[i]);
    return sum;
}

// Over the diagonal, so that it is an error of W at most so many steps away.
static double residual(const struct equations *e, const vec3 *r) {
    double largest = 0;
    for (uint32_t i = 0; i < e->space->count; i++)
        largest = fmax(largest, vec3_length(r[i]) / e->diagonal[i]);
    return e->largest > 0 ? largest / e->largest : 0;
}

// From W = 0. r = b − A W all along.
static void solve(const struct equations *e, struct harmonic *out) {
    uint32_t n = out->count;
    vec3 *r = e->b, *z = alloc(n, sizeof *z), *p = alloc(n, sizeof *p), *Ap = alloc(n, sizeof *Ap);
    precondition(e, r, z);
    double rz = dot(r, z, n);
    for (uint32_t i = 0; i < n; i++)
        p[i] = z[i];
    while ((out->residual = residual(e, r)) > TOLERANCE && out->steps < STEPS_MAX) {
        multiply(e, p, Ap);
        double length = rz / dot(p, Ap, n);
        for (uint32_t i = 0; i < n; i++) {
            out->values[i] = vec3_add_scaled(out->values[i], length, p[i]);
            r[i] = vec3_add_scaled(r[i], -length, Ap[i]);
        }
        precondition(e, r, z);
        double before = rz;
        rz = dot(r, z, n);
        for (uint32_t i = 0; i < n; i++)
            p[i] = vec3_add_scaled(z[i], rz / before, p[i]);
        out->steps++;
    }
    free(z);
    free(p);
    free(Ap);
}

void harmonic_solve(const struct harmonic_setup *setup, struct harmonic *out) {
    struct grid grid;
    grid_init(&grid, setup);
    cross_surfaces(&grid);
    *out = (struct harmonic){.origin = grid.origin, .spacing_mm = setup->spacing_mm};
    for (int a = 0; a < 3; a++)
        out->size[a] = grid.size[a];
    find_space(&grid, out);
    size_t count = out->count ? out->count : 1;
    out->neighbours = alloc(count, sizeof *out->neighbours);
    out->values = alloc(count, sizeof(vec3));
    struct equations e = {out, alloc(count, sizeof(double)), alloc(count, sizeof(double)),
                          alloc(count, sizeof(vec3)), 0};
    for (uint32_t i = 0; i < out->count; i++)
        set_row(&grid, out, &e, i);
    grid_fini(&grid);
    set_factor(&e);
    solve(&e, out);
    free(e.diagonal);
    free(e.factor);
    free(e.b);
}

void harmonic_fini(struct harmonic *harmonic) {
    free(harmonic->index);
    free(harmonic->nodes);
    free(harmonic->neighbours);
    free(harmonic->values);
    *harmonic = (struct harmonic){0};
}

static vec3 place_of(const struct harmonic *h, uint32_t node) {
    uint32_t x = (uint32_t)h->size[0], y = (uint32_t)h->size[1];
    vec3 steps = {node % x, node / x % y, node / x / y};
    return vec3_add_scaled(h->origin, h->spacing_mm, steps);
}

vec3 harmonic_place(const struct harmonic *harmonic, uint32_t i) {
    return place_of(harmonic, harmonic->nodes[i]);
}

uint32_t harmonic_find(const struct harmonic *h, vec3 place) {
    vec3 steps = vec3_scale(1 / h->spacing_mm, vec3_sub(place, h->origin));
    const double at[3] = {round(steps.x), round(steps.y), round(steps.z)};
    for (int a = 0; a < 3; a++)
        if (!(at[a] >= 0 && at[a] < h->size[a]))
            return HARMONIC_NONE;
    double node = at[0] + h->size[0] * (at[1] + h->size[1] * at[2]);
    return h->index[(size_t)node];
}

bool harmonic_at(const struct harmonic *h, vec3 place, vec3 *out) {
    vec3 steps = vec3_scale(1 / h->spacing_mm, vec3_sub(place, h->origin)), sum = {0};
    double known = 0;
    for (int x = 0; x < 2; x++)
        for (int y = 0; y < 2; y++)
            for (int z = 0; z < 2; z++) {
                vec3 at = {floor(steps.x) + x, floor(steps.y) + y, floor(steps.z) + z};
                vec3 off = vec3_sub(steps, at);
                double weight = (1 - fabs(off.x)) * (1 - fabs(off.y)) * (1 - fabs(off.z));
                uint32_t i = harmonic_find(h, vec3_add_scaled(h->origin, h->spacing_mm, at));
                if (i == HARMONIC_NONE || weight < SHARE_LEAST)
                    continue;
                sum = vec3_add_scaled(sum, weight, h->values[i]);
                known += weight;
            }
    *out = vec3_scale(known > 0 ? 1 / known : 0, sum);
    return known > 0;
}

bool harmonic_gradient(const struct harmonic *h, uint32_t i, mat3 *out) {
    for (int axis = 0; axis < 3; axis++) {
        uint32_t next = h->neighbours[i][2 * axis + 1];
        if (next == HARMONIC_NONE)
            return false;
        vec3 slope = vec3_scale(1 / h->spacing_mm, vec3_sub(h->values[next], h->values[i]));
        out->m[0][axis] = slope.x;
        out->m[1][axis] = slope.y;
        out->m[2][axis] = slope.z;
    }
    return true;
}
