// Where nothing of T is left far and wide, S'' cannot draw back to it. There it lies down on its
// own underside, which is on the plateau.
#include "base/check.h"
#include "match/conform_parts.h"
#include "match/room.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CELL_MM 1.0
#define FAR_MM 8.0    // a cell without tissue within so much, in plan
#define SOME 16       // of so many triangles one is looked at first
#define AROUND_MM 6.0 // what is so near to such a cell sinks
#define RAMP_MM 1.0   // all of the way where it is nearer by so much
#define SHEET 0.02    // of its height is left of what has sunk
#define LEVEL_MM 2.5  // around a place where the sheet has to be thicker
#define ROUNDS 12
#define SOFT_ROUND 3 // from there on what crosses is smoothed, too
#define SWEEPS 10
#define RINGS 3
#define MOVABLE 0.99 // as good as laid, but cuts may still move it
#define LEAST_SHARE 0.02
#define UNDER_MM 4.0 // of the underside that say how high it is at a place
#define FACING_DOWN -0.5
#define HALVINGS 5

// ---- in plan, seen along z ----------------------------------------------------------------------

// Of the underside of S' in one cell: its area, and the middle of it times that.
struct under {
    double area;
    vec3 sum;
};

enum distance { UNKNOWN, NEAR, FAR };

struct plan {
    vec3 origin;
    int size[2];
    // By cell:
    bool *tissue;
    uint8_t *distance; // to tissue
    uint8_t *level;    // of the sheet's thickness
    bool *rising;
    struct under *under;
};

static size_t cell_count(const struct plan *plan) {
    return (size_t)plan->size[0] * (size_t)plan->size[1];
}

static int line_of(const struct plan *plan, double x, int axis) {
    double at = floor((x - (axis ? plan->origin.y : plan->origin.x)) / CELL_MM);
    return at < 0 ? 0 : at >= plan->size[axis] ? plan->size[axis] - 1 : (int)at;
}

static size_t cell_of(const struct plan *plan, vec3 p) {
    return (size_t)line_of(plan, p.x, 0) * (size_t)plan->size[1] + (size_t)line_of(plan, p.y, 1);
}

static void add_underside(struct plan *plan, const struct match_surface *s) {
    for (uint32_t t = 0; t < s->triangle_count; t++) {
        vec3 c[3];
        for (int i = 0; i < 3; i++)
            c[i] = s->start[s->triangles[3 * (size_t)t + (size_t)i]];
        vec3 area2 = soup_area2(c);
        double area = 0.5 * vec3_length(area2);
        if (!(area2.z < 2 * FACING_DOWN * area))
            continue;
        vec3 middle = vec3_scale(1.0 / 3, vec3_add(c[0], vec3_add(c[1], c[2])));
        struct under *under = &plan->under[cell_of(plan, middle)];
        under->area += area;
        under->sum = vec3_add_scaled(under->sum, area, middle);
    }
}

static void plan_init(struct plan *plan, const struct match_surface *s) {
    vec3 low = s->start[0], high = s->start[0];
    for (uint32_t v = 1; v < s->vertex_count; v++) {
        low = (vec3){lower(low.x, s->start[v].x), lower(low.y, s->start[v].y), 0};
        high = (vec3){higher(high.x, s->start[v].x), higher(high.y, s->start[v].y), 0};
    }
    plan->origin = low;
    plan->size[0] = (int)((high.x - low.x) / CELL_MM) + 1;
    plan->size[1] = (int)((high.y - low.y) / CELL_MM) + 1;
    plan->tissue = alloc(cell_count(plan), sizeof *plan->tissue);
    plan->distance = alloc(cell_count(plan), sizeof *plan->distance);
    plan->level = alloc(cell_count(plan), sizeof *plan->level);
    plan->rising = alloc(cell_count(plan), sizeof *plan->rising);
    plan->under = alloc(cell_count(plan), sizeof *plan->under);
}

static void plan_fini(struct plan *plan) {
    free(plan->tissue);
    free(plan->distance);
    free(plan->level);
    free(plan->rising);
    free(plan->under);
}

// Calls visit for the cells whose middles are within a distance of the point, until it is false.
static bool around(const struct plan *plan, vec3 p, double within,
                   bool (*visit)(void *context, size_t cell, double distance2), void *context) {
    int low[2] = {line_of(plan, p.x - within, 0), line_of(plan, p.y - within, 1)};
    int high[2] = {line_of(plan, p.x + within, 0), line_of(plan, p.y + within, 1)};
    for (int i = low[0]; i <= high[0]; i++)
        for (int k = low[1]; k <= high[1]; k++) {
            double x = plan->origin.x + (i + 0.5) * CELL_MM - p.x;
            double y = plan->origin.y + (k + 0.5) * CELL_MM - p.y;
            size_t cell = (size_t)i * (size_t)plan->size[1] + (size_t)k;
            if (x * x + y * y <= within * within && !visit(context, cell, x * x + y * y))
                return false;
        }
    return true;
}

// ---- where tissue is gone -----------------------------------------------------------------------

static void mark_some_corners(struct plan *plan, const struct mesh *tissue) {
    for (uint32_t t = 0; t < tissue->triangle_count; t += SOME)
        plan->tissue[cell_of(plan, mesh_corner(tissue, t, 0))] = true;
}

static void mark_tissue(struct plan *plan, const struct mesh *tissue) {
    for (uint32_t t = 0; t < tissue->triangle_count; t++) {
        vec3 a = mesh_corner(tissue, t, 0), b = mesh_corner(tissue, t, 1);
        vec3 c = mesh_corner(tissue, t, 2);
        int from = line_of(plan, lower(a.y, lower(b.y, c.y)), 1);
        int to = line_of(plan, higher(a.y, higher(b.y, c.y)), 1);
        for (int i = line_of(plan, lower(a.x, lower(b.x, c.x)), 0);
             i <= line_of(plan, higher(a.x, higher(b.x, c.x)), 0); i++)
            for (int k = from; k <= to; k++)
                plan->tissue[(size_t)i * (size_t)plan->size[1] + (size_t)k] = true;
    }
}

static bool is_free(void *context, size_t cell, double distance2) {
    (void)distance2;
    return !((const struct plan *)context)->tissue[cell];
}

// The first vertex of S' in each cell; the cells are the same for each call.
static void find_firsts(struct conform *c, struct plan *plan) {
    const struct match_surface *s = c->surface;
    for (uint32_t v = 0; v < s->vertex_count; v++) {
        size_t cell = cell_of(plan, s->start[v]);
        if (plan->distance[cell] == NEAR)
            continue;
        plan->distance[cell] = NEAR;
        room_for(&c->firsts, &c->first_room, c->first_count + 1);
        c->firsts[c->first_count++] = v;
    }
}

// Of the cells over S'; false: none.
static bool mark_far(struct conform *c, struct plan *plan) {
    bool any = false;
    if (!c->first_count)
        find_firsts(c, plan);
    memset(plan->distance, UNKNOWN, cell_count(plan) * sizeof *plan->distance);
    for (uint32_t i = 0; i < c->first_count; i++) {
        vec3 p = c->surface->start[c->firsts[i]];
        size_t cell = cell_of(plan, p);
        bool far = !plan->tissue[cell] && around(plan, p, FAR_MM, is_free, plan);
        plan->distance[cell] = far ? FAR : NEAR;
        any |= far;
    }
    return any;
}

// Mostly some corners of the tissue tell already that nothing is far from it.
static bool find_far(struct conform *c, struct plan *plan, const struct mesh *tissue) {
    mark_some_corners(plan, tissue);
    if (!mark_far(c, plan))
        return false;
    mark_tissue(plan, tissue);
    return mark_far(c, plan);
}

struct nearest {
    const struct plan *plan;
    double distance2;
};

static bool is_nearest(void *context, size_t cell, double distance2) {
    struct nearest *nearest = context;
    if (nearest->plan->distance[cell] == FAR)
        nearest->distance2 = lower(nearest->distance2, distance2);
    return true;
}

// How much of the way down a vertex is to go: 0 to 1.
static double share_of(const struct plan *plan, vec3 p) {
    struct nearest nearest = {plan, AROUND_MM * AROUND_MM};
    around(plan, p, AROUND_MM, is_nearest, &nearest);
    return lower(1, (AROUND_MM - sqrt(nearest.distance2)) / RAMP_MM);
}

// ---- how high the underside is ------------------------------------------------------------------

// A plane by least squares: rows 1, x, y from the point on, symmetric.
struct plane_fit {
    const struct plan *plan;
    vec3 at;
    double m[6], right[3];
};

static bool add_under(void *context, size_t cell, double distance2) {
    struct plane_fit *fit = context;
    const struct under *under = &fit->plan->under[cell];
    if (!(under->area > 0))
        return true;
    double near = 1 - distance2 / (UNDER_MM * UNDER_MM), weight = under->area * near * near;
    vec3 p = vec3_sub(vec3_scale(1 / under->area, under->sum), fit->at);
    const double row[3] = {1, p.x, p.y};
    for (int i = 0, k = 0; i < 3; i++) {
        for (int j = i; j < 3; j++)
            fit->m[k++] += weight * row[i] * row[j];
        fit->right[i] += weight * row[i] * p.z;
    }
    return true;
}

// Without a plane the mean height, without an underside the point's own.
static double floor_at(const struct plan *plan, vec3 p) {
    struct plane_fit fit = {.plan = plan, .at = p};
    around(plan, p, UNDER_MM, add_under, &fit);
    const double *m = fit.m, *r = fit.right;
    if (!(m[0] > 0))
        return p.z;
    double a = m[3] * m[5] - m[4] * m[4], b = m[2] * m[4] - m[1] * m[5];
    double d = m[1] * m[4] - m[2] * m[3], det = m[0] * a + m[1] * b + m[2] * d;
    bool is_plane = det > 1e-3 * m[0] * m[0] * m[0];
    return p.z + (is_plane ? (a * r[0] + b * r[1] + d * r[2]) / det : r[0] / m[0]);
}

// ---- sinking ------------------------------------------------------------------------------------

struct laying {
    struct plan plan;
    double way_most; // of S'_max
    // By vertex:
    double *shares, *floors;
    bool *soft;
    uint8_t *rings; // 1: it sinks; more: around that; 0: neither
};

struct mean_level {
    const struct plan *plan;
    double sum, weights;
};

static bool add_level(void *context, size_t cell, double distance2) {
    struct mean_level *mean = context;
    double near = 1 - distance2 / (LEVEL_MM * LEVEL_MM);
    mean->sum += near * near * mean->plan->level[cell];
    mean->weights += near * near;
    return true;
}

// Along z heights over the floor keep their order, so that nothing new crosses but for what lies
// between vertices. None rises over S', and none sinks by more than S'_max moves anything.
static double sunk(const struct laying *l, vec3 p, double floor) {
    struct mean_level mean = {&l->plan, 0, 0};
    around(&l->plan, p, LEVEL_MM, add_level, &mean);
    double rank = mean.weights > 0 ? 1 + mean.sum / mean.weights : 1;
    double share = lower(1, SHEET * rank * rank);
    return floor + higher(share * (p.z - floor), p.z - floor - l->way_most);
}

static bool sinks(const struct conform *c, const struct laying *l, uint32_t v) {
    return l->shares[v] > c->laid[v] + LEAST_SHARE;
}

static void sink(struct conform *c, const struct laying *l) {
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t v = c->active[i];
        vec3 p = c->surface->start[v];
        p.z += l->shares[v] * (sunk(l, p, l->floors[v]) - p.z);
        c->positions[v] = sinks(c, l, v) ? p : c->sound[v];
    }
}

static vec3 middle_of(const struct conform *c, uint32_t vertex) {
    uint32_t degree = conform_degree(c, vertex);
    vec3 sum = {0};
    for (uint32_t k = 0; k < degree; k++)
        sum =
            vec3_add(sum, c->positions[c->surface->opposites[c->surface->first[vertex] + k].from]);
    return degree ? vec3_scale(1.0 / degree, sum) : c->positions[vertex];
}

// What is soft goes to the middle of its neighbours.
static void smooth(struct conform *c, const struct laying *l) {
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (uint32_t i = 0; i < c->active_count; i++)
            if (l->soft[c->active[i]])
                c->step[i] = middle_of(c, c->active[i]);
        for (uint32_t i = 0; i < c->active_count; i++)
            if (l->soft[c->active[i]])
                c->positions[c->active[i]] = c->step[i];
    }
}

static bool rise(void *context, size_t cell, double distance2) {
    (void)distance2;
    ((struct plan *)context)->rising[cell] = true;
    return true;
}

// Where it crosses itself the sheet gets thicker; if that is not enough, it gets smooth.
static void thicken(struct conform *c, struct plan *plan) {
    memset(plan->rising, 0, cell_count(plan) * sizeof *plan->rising);
    for (uint32_t i = 0; i < c->active_count; i++)
        if (c->tied[c->active[i]])
            around(plan, c->surface->start[c->active[i]], CELL_MM, rise, plan);
    for (size_t i = 0; i < cell_count(plan); i++)
        plan->level[i] += plan->rising[i];
}

static void soften(struct conform *c, struct laying *l, int rings) {
    conform_spread(c, rings);
    for (uint32_t i = 0; i < c->active_count; i++)
        l->soft[c->active[i]] |= c->tied[c->active[i]];
}

static void lay(struct conform *c, struct laying *l) {
    sink(c, l);
    for (int round = 1; round < ROUNDS && conform_cross(c); round++) {
        thicken(c, &l->plan);
        if (round >= SOFT_ROUND)
            soften(c, l, 1 + (round - SOFT_ROUND) / 2);
        sink(c, l);
        smooth(c, l);
    }
    conform_go_back(c, HALVINGS);
    for (uint32_t i = 0; i < c->active_count; i++) {
        uint32_t v = c->active[i];
        bool clean = !l->soft[v] && !(c->factor[v] < 1);
        if (sinks(c, l, v) && c->factor[v] > 0) // else it is tried again after the next cut
            c->laid[v] = clean ? l->shares[v] : lower(l->shares[v], MOVABLE);
    }
}

static bool is_beside(const struct conform *c, const struct laying *l, uint32_t v, uint8_t ring) {
    for (uint32_t k = c->surface->first[v]; k < c->surface->first[v + 1]; k++) {
        uint32_t at = c->surface->opposites[k].from;
        if (l->rings[at] && l->rings[at] <= ring)
            return true;
    }
    return false;
}

// What sinks, and some rings around it, which make room where they must.
static void choose(struct conform *c, struct laying *l) {
    const struct match_surface *s = c->surface;
    l->shares = alloc(s->vertex_count, sizeof *l->shares);
    l->floors = alloc(s->vertex_count, sizeof *l->floors);
    l->soft = alloc(s->vertex_count, sizeof *l->soft);
    l->rings = alloc(s->vertex_count, sizeof *l->rings);
    for (uint32_t v = 0; v < s->vertex_count; v++) {
        l->way_most = higher(l->way_most, vec3_length(s->way[v]));
        l->shares[v] = share_of(&l->plan, s->start[v]);
        l->rings[v] = sinks(c, l, v);
        if (l->rings[v])
            l->floors[v] = floor_at(&l->plan, s->start[v]);
    }
    for (uint8_t ring = 1; ring <= RINGS; ring++)
        for (uint32_t v = 0; v < s->vertex_count; v++)
            if (!l->rings[v] && c->laid[v] < 1 && is_beside(c, l, v, ring))
                l->rings[v] = ring + 1;
    for (uint32_t v = 0; v < s->vertex_count; v++)
        if (l->rings[v])
            c->active[c->active_count++] = v;
}

bool conform_lay(struct conform *c, const struct mesh *tissue) {
    struct laying l = {0};
    c->active_count = 0;
    plan_init(&l.plan, c->surface);
    if (find_far(c, &l.plan, tissue)) {
        add_underside(&l.plan, c->surface);
        choose(c, &l);
    }
    if (c->active_count) {
        conform_gather_active(c);
        lay(c, &l);
    }
    plan_fini(&l.plan);
    free(l.shares);
    free(l.floors);
    free(l.soft);
    free(l.rings);
    return c->active_count > 0;
}

// ---- what it holds ------------------------------------------------------------------------------

static bool is_laid(const struct conform *c, uint32_t triangle) {
    const uint32_t *v = c->surface->triangles + 3 * (size_t)triangle;
    return c->laid[v[0]] >= 1 && c->laid[v[1]] >= 1 && c->laid[v[2]] >= 1;
}

static bool is_any_laid(const struct conform *c) {
    bool any = false;
    for (uint32_t v = 0; v < c->surface->vertex_count; v++)
        any |= c->laid[v] >= 1;
    return any;
}

double conform_sheet(const struct conform *c) {
    struct plan plan = {0};
    double sum = 0;
    if (!is_any_laid(c))
        return 0;
    for (uint32_t t = 0; t < c->surface->triangle_count; t++) {
        vec3 corners[3];
        if (!is_laid(c, t))
            continue;
        if (!plan.under) {
            plan_init(&plan, c->surface);
            add_underside(&plan, c->surface);
        }
        conform_corners(c, t, corners);
        for (int i = 0; i < 3; i++)
            sum += soup_area2(corners).z / 6 * (corners[i].z - floor_at(&plan, corners[i]));
    }
    plan_fini(&plan);
    return sum;
}
