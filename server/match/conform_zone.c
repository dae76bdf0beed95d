// Which part of S'' a cut concerns.
#include "base/check.h"
#include "match/conform_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GROW_MM 1.6 // from a seed along edges; two edges at least
#define GROW_RINGS 2
#define OFF_FRESH_MM 0.02
#define OFF_DIRTY_MM 0.08
#define SEARCH_MM 8.0
#define DIRTY_CUTS 3
#define LEAST_FACING -0.3
#define ANY_FACING -2.0
#define SLACK_MM 1e-9 // more than distances are rounded

// ---- the neighbourhood --------------------------------------------------------------------------

static struct box empty_box(void) {
    return (struct box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

static void extend(struct box *box, vec3 p) {
    box->min = (vec3){lower(box->min.x, p.x), lower(box->min.y, p.y), lower(box->min.z, p.z)};
    box->max = (vec3){higher(box->max.x, p.x), higher(box->max.y, p.y), higher(box->max.z, p.z)};
}

static struct box grown(struct box box, double by) {
    vec3 v = {by, by, by};
    return (struct box){vec3_sub(box.min, v), vec3_add(box.max, v)};
}

// One bit for each side of a box that a point is beyond. A triangle whose corners are all beyond
// one side does not meet the box.
static uint8_t sides_beyond(struct box box, vec3 p) {
    return (uint8_t)((p.x < box.min.x) | (p.x > box.max.x) << 1 | (p.y < box.min.y) << 2 |
                     (p.y > box.max.y) << 3 | (p.z < box.min.z) << 4 | (p.z > box.max.z) << 5);
}

static bool meets(const uint8_t *off, const uint32_t *corners) {
    return !(off[corners[0]] & off[corners[1]] & off[corners[2]]);
}

static void target_corners(const struct mesh *mesh, uint32_t t, vec3 out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = mesh_corner(mesh, t, i);
}

// Around all that may move.
static double beside_mm(const struct conform *c) {
    return higher(c->plan->beside_mm, c->plan->beside_edges * c->surface->spacing);
}

static void gather_near(struct conform *c) {
    c->near_count = 0;
    c->is_made = false;
    for (uint32_t v = 0; v < c->surface->vertex_count; v++)
        c->off[v] = sides_beyond(c->zone, c->positions[v]);
    for (uint32_t t = 0; t < c->surface->triangle_count; t++) {
        bool near = meets(c->off, c->surface->triangles + 3 * (size_t)t);
        c->near[c->near_count] = t;
        c->near_count += near;
    }
}

static bool holds(struct box box, struct box other) {
    return box.min.x <= other.min.x && box.min.y <= other.min.y && box.min.z <= other.min.z &&
           box.max.x >= other.max.x && box.max.y >= other.max.y && box.max.z >= other.max.z;
}

void conform_widen(struct conform *c) {
    struct box live = empty_box();
    for (uint32_t i = 0; i < c->live_count; i++)
        for (int k = 0; k < 3; k++)
            extend(&live, c->positions[c->surface->triangles[3 * (size_t)c->live[i] + (size_t)k]]);
    if (!c->live_count || holds(c->zone, live))
        return;
    live = grown(live, beside_mm(c));
    extend(&live, c->zone.min);
    extend(&live, c->zone.max);
    c->zone = live;
    gather_near(c);
}

static struct box box_of_active(const struct conform *c) {
    struct box box = empty_box();
    for (uint32_t i = 0; i < c->active_count; i++)
        extend(&box, c->positions[c->active[i]]);
    return box;
}

static void none_live(struct conform *c) {
    for (uint32_t t = 0; t < c->surface->triangle_count; t++)
        c->live_of[t] = MESH_NONE;
}

void conform_gather_active(struct conform *c) {
    c->zone = grown(box_of_active(c), beside_mm(c));
    for (uint32_t v = 0; v < c->surface->vertex_count; v++)
        c->slot[v] = MESH_NONE;
    none_live(c);
    gather_near(c);
    conform_activate(c);
}

static struct box box_of_fresh(const struct conform_target *target) {
    struct box fresh = empty_box();
    for (uint32_t t = 0; t < target->mesh->triangle_count; t++)
        for (int i = 0; target->fresh[t] && i < 3; i++)
            extend(&fresh, mesh_corner(target->mesh, t, i));
    return fresh;
}

static void gather_target(struct conform *c, const struct conform_target *target) {
    const struct mesh *mesh = target->mesh;
    uint8_t *off = alloc(mesh->vertex_count, sizeof *off);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        off[v] = sides_beyond(c->zone, mesh_vertex(mesh, v));
    conform_keep_films(c);
    soup_clear(&c->whole_target);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 corners[3];
        if (!meets(off, mesh->triangles + 3 * (size_t)t))
            continue;
        target_corners(mesh, t, corners);
        soup_add(&c->whole_target, corners, t, target->fresh[t]);
    }
    free(off);
    soup_build(&c->whole_target);
}

bool conform_gather(struct conform *c, const struct conform_target *target) {
    struct box fresh = box_of_fresh(target);
    if (!(fresh.min.x <= fresh.max.x))
        return false;
    c->zone = grown(fresh, higher(GROW_MM, GROW_RINGS * c->surface->spacing) + beside_mm(c));
    c->origin = fresh.min;
    gather_target(c, target);
    conform_leave_out_films(c);
    none_live(c);
    gather_near(c);
    return c->near_count > 0;
}

// Sums of areas over the triangles, for the vertices that are chosen, or all; in the order of ids.
static void find_normals(struct conform *c, const uint32_t *triangles, uint32_t count,
                         const uint8_t *chosen) {
    const uint32_t *corners = c->surface->triangles;
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = corners[3 * (size_t)triangles[i] + (size_t)k];
            if (!chosen || chosen[v])
                c->normals[v] = (vec3){0};
        }
    for (uint32_t i = 0; i < count; i++) {
        vec3 points[3];
        conform_corners(c, triangles[i], points);
        vec3 area2 = soup_area2(points);
        for (int k = 0; k < 3; k++) {
            uint32_t v = corners[3 * (size_t)triangles[i] + (size_t)k];
            if (!chosen || chosen[v])
                c->normals[v] = vec3_add(c->normals[v], area2);
        }
    }
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = corners[3 * (size_t)triangles[i] + (size_t)k];
            if (!chosen || chosen[v])
                c->normals[v] = vec3_unit_or(c->normals[v], (vec3){0});
        }
}

// What moves: corners of live triangles, and the triangles around them.
static void choose_beside(struct conform *c) {
    const uint32_t *corners = c->surface->triangles;
    memset(c->moves, 0, c->surface->vertex_count);
    c->beside_count = 0;
    for (uint32_t i = 0; i < c->live_count; i++)
        for (int k = 0; k < 3; k++)
            c->moves[corners[3 * (size_t)c->live[i] + (size_t)k]] = 1;
    for (uint32_t i = 0; i < c->near_count; i++) {
        const uint32_t *v = corners + 3 * (size_t)c->near[i];
        if (c->moves[v[0]] || c->moves[v[1]] || c->moves[v[2]])
            c->beside[c->beside_count++] = c->near[i];
    }
}

// self holds what is near, in this order.
static void mark_live(struct conform *c) {
    for (uint32_t i = 0; i < c->near_count; i++) {
        uint32_t live = c->live_of[c->near[i]];
        c->self.at[i].mark = live != MESH_NONE;
        if (live != MESH_NONE)
            c->self_of[live] = i;
    }
    choose_beside(c);
}

static void make_all(struct conform *c) {
    soup_clear(&c->self);
    for (uint32_t i = 0; i < c->near_count; i++) {
        vec3 corners[3];
        conform_corners(c, c->near[i], corners);
        soup_add(&c->self, corners, c->near[i], false);
    }
    soup_build(&c->self);
    find_normals(c, c->near, c->near_count, NULL);
    mark_live(c);
    c->is_made = true;
}

static void move_live(struct conform *c) {
    conform_move_self(c);
    find_normals(c, c->beside, c->beside_count, c->moves);
}

void conform_move_self(struct conform *c) {
    for (uint32_t i = 0; i < c->live_count; i++) {
        vec3 corners[3];
        conform_corners(c, c->live[i], corners);
        soup_move(&c->self, c->self_of[i], corners);
    }
    soup_settle(&c->self);
}

void conform_make_self(struct conform *c) {
    (c->is_made ? move_live : make_all)(c);
}

// ---- seeds --------------------------------------------------------------------------------------

struct seeding {
    struct conform *c;
    struct box fresh; // of T, around what the cut made
    uint32_t queued;
    uint32_t hint; // of T, where the last one was
};

static void seed(struct seeding *s, uint32_t vertex) {
    struct conform *c = s->c;
    if (c->reach[vertex] == 0)
        return;
    if (!isfinite(c->reach[vertex]))
        c->queue[s->queued++] = vertex;
    c->reach[vertex] = 0;
    c->ring[vertex] = 0;
}

static double off_box(struct box box, vec3 p) {
    vec3 off = {higher(0, higher(box.min.x - p.x, p.x - box.max.x)),
                higher(0, higher(box.min.y - p.y, p.y - box.max.y)),
                higher(0, higher(box.min.z - p.z, p.z - box.max.z))};
    return vec3_length(off);
}

// What is closer to the last triangle found than to all that is fresh is closest to no fresh one.
static bool is_far_from_fresh(const struct seeding *s, vec3 p, vec3 normal) {
    const struct soup *target = &s->c->target;
    struct soup_closest closest;
    if (s->hint == MESH_NONE || vec3_dot(normal, target->at[s->hint].normal) < LEAST_FACING)
        return false;
    soup_closest_on(target, s->hint, p, &closest);
    return closest.distance < SEARCH_MM && closest.distance + SLACK_MM < off_box(s->fresh, p);
}

// Whether a point of S'' is off T where the cut, or an earlier one, left something to do.
static bool is_off(struct seeding *s, vec3 p, vec3 normal, bool dirty) {
    const struct soup *target = &s->c->target;
    struct soup_search search = {p, normal, LEAST_FACING, SEARCH_MM, s->hint};
    struct soup_closest closest;
    if ((!dirty && is_far_from_fresh(s, p, normal)) || !soup_closest(target, &search, &closest))
        return false;
    s->hint = closest.index;
    return (target->at[closest.index].mark && closest.distance > OFF_FRESH_MM) ||
           (dirty && closest.distance > OFF_DIRTY_MM);
}

static void seed_triangle(struct seeding *s, const struct soup_triangle *t) {
    struct conform *c = s->c;
    const uint32_t *v = c->surface->triangles + 3 * (size_t)t->id;
    bool dirty = c->dirty[v[0]] || c->dirty[v[1]] || c->dirty[v[2]];
    vec3 middle = vec3_add(t->corners[0], vec3_add(t->corners[1], t->corners[2]));
    if (is_off(s, vec3_scale(1.0 / 3, middle), t->normal, dirty))
        for (int i = 0; i < 3; i++)
            seed(s, v[i]);
    for (int i = 0; i < 3; i++)
        if (!c->slot[v[i]]) { // not yet looked at
            c->slot[v[i]] = 1;
            if (is_off(s, t->corners[i], c->normals[v[i]], c->dirty[v[i]]))
                seed(s, v[i]);
        }
}

// All lies on T: what the cut took, a film perhaps, comes off S'' nearby.
static void seed_beside_fresh(struct seeding *s) {
    struct conform *c = s->c;
    for (uint32_t i = 0; i < c->whole_target.count; i++) {
        const struct soup_triangle *t = &c->whole_target.at[i];
        struct soup_search search = {t->corners[0], t->normal, ANY_FACING, SEARCH_MM, MESH_NONE};
        struct soup_closest closest;
        if (t->mark && soup_closest(&c->self, &search, &closest))
            for (int k = 0; k < 3; k++)
                seed(s,
                     c->surface->triangles[3 * (size_t)c->self.at[closest.index].id + (size_t)k]);
    }
}

static void reach_from(struct seeding *s, uint32_t vertex) {
    struct conform *c = s->c;
    for (uint32_t k = c->surface->first[vertex]; k < c->surface->first[vertex + 1]; k++) {
        uint32_t to = c->surface->opposites[k].from;
        double way = c->reach[vertex] + vec3_distance(c->positions[vertex], c->positions[to]);
        int ring = c->ring[vertex] + 1;
        if (ring > GROW_RINGS && way > GROW_MM)
            continue;
        if (!isfinite(c->reach[to])) {
            c->queue[s->queued++] = to;
            c->ring[to] = UINT8_MAX;
        }
        c->reach[to] = lower(c->reach[to], way);
        c->ring[to] = (uint8_t)(ring < c->ring[to] ? ring : c->ring[to]);
    }
}

static struct box fresh_box(const struct soup *target) {
    struct box box = empty_box();
    for (uint32_t t = 0; t < target->count; t++)
        for (int i = 0; target->at[t].mark && i < 3; i++)
            extend(&box, target->at[t].corners[i]);
    return box;
}

void conform_seed(struct conform *c) {
    struct seeding s = {c, fresh_box(&c->target), 0, MESH_NONE};
    uint32_t count = c->surface->vertex_count;
    for (uint32_t v = 0; v < count; v++) {
        c->reach[v] = INFINITY;
        c->slot[v] = 0;
        if (c->dirty[v])
            c->dirty[v]--;
    }
    for (uint32_t i = 0; i < c->self.count; i++)
        seed_triangle(&s, &c->self.at[i]);
    if (!s.queued)
        seed_beside_fresh(&s);
    for (uint32_t i = 0; i < s.queued; i++)
        reach_from(&s, c->queue[i]);
    c->active_count = 0;
    for (uint32_t v = 0; v < count; v++) {
        c->slot[v] = MESH_NONE;
        if (isfinite(c->reach[v]) && c->laid[v] < 1)
            c->active[c->active_count++] = v;
    }
}

// A vertex whose fan is not all near stays where it is.
void conform_activate(struct conform *c) {
    uint8_t *near = c->tied;
    memset(near, 0, c->surface->vertex_count);
    for (uint32_t i = 0; i < c->near_count; i++)
        for (int k = 0; k < 3; k++)
            near[c->surface->triangles[3 * (size_t)c->near[i] + (size_t)k]]++;
    uint32_t count = 0;
    for (uint32_t i = 0; i < c->active_count; i++)
        if (near[c->active[i]] == (uint8_t)conform_degree(c, c->active[i])) {
            c->slot[c->active[i]] = count;
            c->dirty[c->active[i]] = DIRTY_CUTS;
            c->active[count++] = c->active[i];
        }
    c->active_count = count;
    c->live_count = 0;
    for (uint32_t i = 0; i < c->near_count; i++) {
        const uint32_t *v = c->surface->triangles + 3 * (size_t)c->near[i];
        if (c->slot[v[0]] == MESH_NONE && c->slot[v[1]] == MESH_NONE && c->slot[v[2]] == MESH_NONE)
            continue;
        c->live_of[c->near[i]] = c->live_count;
        c->live[c->live_count++] = c->near[i];
    }
    if (c->is_made)
        mark_live(c);
}
