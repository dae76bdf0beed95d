#include "step/easing.h"

#include "base/check.h"
#include "step/settings.h"

#include <stdlib.h>
#include <string.h>

// What one session has of its own, once a job has changed the touch.
struct easing_room {
    float *displacement;
    struct surface_mean *mean;
    struct surface_integral *integral;
    float *aimed;                   // the displacement when all is eased in; NULL without integral
    struct surface_integral *whole; // of it
    double *now, *target;           // of all vertices
    uint32_t *pending;              // vertices that are not yet at the target
    bool *is_pending;
    uint32_t pending_count;
};

struct easing {
    const struct scene *scene;
    const struct scene_tissue *tissue;
    const struct case_group *group;
    enum field_kind kind;
    const struct query *query;
    int width;                // numbers for each vertex, as in struct touch_change
    struct easing_room *room; // the session's; NULL: all is as in the scene
    struct easing_room *made; // for it, by the thread that runs the jobs
};

// ---- memory of its own --------------------------------------------------------------------------

static struct easing_room *make(const struct easing *e) {
    size_t count = e->group->mesh.vertex_count;
    struct easing_room *r = alloc(1, sizeof *r);
    r->displacement = alloc(3 * count, sizeof *r->displacement);
    r->now = alloc((size_t)e->width * count, sizeof *r->now);
    r->target = alloc((size_t)e->width * count, sizeof *r->target);
    r->pending = alloc(count, sizeof *r->pending);
    r->is_pending = alloc(count, sizeof *r->is_pending);
    memcpy(r->displacement, e->tissue->start, 3 * count * sizeof *r->displacement);
    if (e->kind == FIELD_SMOOTH && !e->group->bridges)
        r->mean = surface_mean_create(e->scene->trees[e->tissue->group], r->displacement);
    if (e->kind == FIELD_INTEGRAL && !e->group->bridges) {
        r->aimed = alloc(3 * count, sizeof *r->aimed);
        memcpy(r->aimed, r->displacement, 3 * count * sizeof *r->aimed);
        r->integral = surface_integral_create(e->scene->blocks[e->tissue->group], r->displacement);
        r->whole = surface_integral_create(e->scene->blocks[e->tissue->group], r->aimed);
    }
    return r;
}

static void destroy(struct easing_room *r) {
    if (!r)
        return;
    surface_mean_destroy(&r->mean);
    surface_integral_destroy(&r->integral);
    surface_integral_destroy(&r->whole);
    free(r->aimed);
    free(r->displacement);
    free(r->now);
    free(r->target);
    free(r->pending);
    free(r->is_pending);
    free(r);
}

void easing_make_room(struct easing *e) {
    if (!e->room && !e->made)
        e->made = make(e);
}

static struct easing_room *room_of(struct easing *e) {
    if (!e->room)
        e->room = e->made ? e->made : make(e);
    e->made = NULL;
    return e->room;
}

struct easing *easing_create(const struct scene *scene, int tissue, const struct field *field,
                             int rules) {
    struct easing *e = alloc(1, sizeof *e);
    e->scene = scene;
    e->tissue = &scene->tissues[tissue];
    e->group = &scene->knee->groups[e->tissue->group];
    e->kind = field->kind;
    e->query = scene->queries[e->tissue->group];
    e->width = rules >= RULES_TOUCH_FITTED ? 3 : 1;
    return e;
}

void easing_destroy(struct easing **easing) {
    struct easing *e = *easing;
    if (!e)
        return;
    destroy(e->room);
    destroy(e->made);
    free(e);
    *easing = NULL;
}

// ---- what the warp reads ------------------------------------------------------------------------

const float *easing_displacement(const struct easing *e) {
    return e->room ? e->room->displacement : e->tissue->start;
}

const struct surface_mean *easing_mean(const struct easing *e) {
    if (e->room)
        return e->room->mean;
    return e->kind == FIELD_SMOOTH && !e->group->bridges ? e->tissue->start_mean : NULL;
}

const struct surface_integral *easing_integral(const struct easing *e) {
    if (e->room)
        return e->room->integral;
    return e->kind == FIELD_INTEGRAL && !e->group->bridges ? e->tissue->start_integral : NULL;
}

// ---- changes ------------------------------------------------------------------------------------

static double *of(const struct easing *e, double *values, uint32_t vertex) {
    return values + (size_t)e->width * vertex;
}

static bool is_moved(const struct easing *e, uint32_t vertex) {
    const double *now = of(e, e->room->now, vertex);
    for (int i = 0; i < e->width; i++)
        if (now[i] != 0)
            return true;
    return false;
}

static void update(struct easing_room *r, uint32_t changed) {
    if (r->mean)
        surface_mean_update(r->mean, r->pending, changed);
    if (r->integral)
        surface_integral_update(r->integral, r->pending, changed);
}

void easing_restore(struct easing *e) {
    struct easing_room *r = e->room;
    size_t count = e->group->mesh.vertex_count;
    uint32_t changed = 0;
    if (!r)
        return;
    for (uint32_t v = 0; v < count; v++)
        if (is_moved(e, v) || r->is_pending[v])
            r->pending[changed++] = v;
    memset(r->now, 0, (size_t)e->width * count * sizeof *r->now);
    memset(r->target, 0, (size_t)e->width * count * sizeof *r->target);
    memset(r->is_pending, 0, count * sizeof *r->is_pending);
    r->pending_count = 0;
    memcpy(r->displacement, e->tissue->start, 3 * count * sizeof *r->displacement);
    update(r, changed);
    if (!r->whole)
        return;
    memcpy(r->aimed, r->displacement, 3 * count * sizeof *r->aimed);
    surface_integral_update(r->whole, r->pending, changed);
}

static void displace(const struct easing *e, float *displacement, uint32_t vertex,
                     const double *offset) {
    for (size_t k = 0; k < 3; k++) {
        size_t i = 3 * (size_t)vertex + k;
        double by = e->width == 3 ? offset[k] : *offset * (double)e->group->maxcut[i];
        displacement[i] = (float)((double)e->tissue->start[i] + by);
    }
}

void easing_aim(struct easing *e, const struct touch_change *touch) {
    size_t size = (size_t)e->width * sizeof(double);
    CHECK(!touch->count || touch->width == e->width);
    if (!touch->count)
        return;
    struct easing_room *r = room_of(e);
    for (uint32_t i = 0; i < touch->count; i++) {
        uint32_t vertex = touch->vertices[i];
        CHECK(vertex < e->group->mesh.vertex_count);
        memcpy(of(e, r->target, vertex), touch->values + (size_t)e->width * i, size);
        if (r->aimed)
            displace(e, r->aimed, vertex, of(e, r->target, vertex));
        if (r->is_pending[vertex] || !memcmp(of(e, r->now, vertex), of(e, r->target, vertex), size))
            continue;
        r->pending[r->pending_count++] = vertex;
        r->is_pending[vertex] = true;
    }
    if (r->whole)
        surface_integral_update(r->whole, touch->vertices, touch->count);
}

bool easing_active(const struct easing *easing) {
    return easing->room && easing->room->pending_count > 0;
}

static double rest_at(const struct easing *e, uint32_t vertex) {
    const double *now = of(e, e->room->now, vertex), *target = of(e, e->room->target, vertex);
    if (e->width == 3)
        return vec3_length((vec3){target[0] - now[0], target[1] - now[1], target[2] - now[2]});
    const float *to = e->group->maxcut + 3 * (size_t)vertex;
    double reach = vec3_length((vec3){(double)to[0], (double)to[1], (double)to[2]});
    return reach * fabs(*target - *now);
}

static double rest_of(const struct easing *e, const uint32_t *vertices, uint32_t count) {
    double largest = 0;
    for (uint32_t i = 0; i < count; i++)
        largest = fmax(largest, rest_at(e, vertices[i]));
    return largest;
}

double easing_rest_mm(const struct easing *e, vec3 p, uint32_t triangle) {
    const struct easing_room *r = e->room;
    struct closest c;
    struct surface_sight now, whole;
    if (triangle == MESH_NONE || !r)
        return 0;
    if (r->mean)
        return rest_of(e, r->pending, r->pending_count);
    if (r->integral && query_closest(e->query, p, INFINITY, triangle, &c) &&
        surface_integral_at(r->integral, p, c.point, &now) &&
        surface_integral_at(r->whole, p, c.point, &whole))
        return vec3_distance(now.displacement, whole.displacement);
    return rest_of(e, e->group->mesh.triangles + 3 * (size_t)triangle, 3);
}

void easing_advance(struct easing *e, double share) {
    struct easing_room *r = e->room;
    for (uint32_t i = 0; i < r->pending_count; i++) {
        uint32_t vertex = r->pending[i];
        double *now = of(e, r->now, vertex);
        const double *target = of(e, r->target, vertex);
        for (int k = 0; k < e->width; k++)
            now[k] = share < 1 ? now[k] + share * (target[k] - now[k]) : target[k];
        displace(e, r->displacement, vertex, now);
        r->is_pending[vertex] = share < 1;
    }
    update(r, r->pending_count);
    if (share >= 1)
        r->pending_count = 0;
}

// ---- keeping ------------------------------------------------------------------------------------

uint32_t easing_pending_count(const struct easing *easing) {
    return easing->room ? easing->room->pending_count : 0;
}

// All is eased in.
static void settle(struct easing *e, const struct operation *operation, int tissue) {
    struct easing_room *r = room_of(e);
    uint32_t moved = 0, count = e->group->mesh.vertex_count;
    for (uint32_t v = 0; v < count; v++) {
        double values[3];
        operation_touch(operation, tissue, v, values);
        memcpy(of(e, r->target, v), values, (size_t)e->width * sizeof *values);
        memcpy(of(e, r->now, v), values, (size_t)e->width * sizeof *values);
        if (!is_moved(e, v))
            continue;
        displace(e, r->displacement, v, of(e, r->now, v));
        if (r->aimed)
            displace(e, r->aimed, v, of(e, r->now, v));
        r->pending[moved++] = v;
    }
    update(r, moved);
    if (r->whole)
        surface_integral_update(r->whole, r->pending, moved);
}

static void keep_pending(struct easing *e, uint32_t i, struct kept *k) {
    struct easing_room *r = e->room;
    uint32_t *vertex = &r->pending[i];
    kept_count(k, vertex, e->group->mesh.vertex_count - 1);
    kept_holds(k, !r->is_pending[*vertex]);
    double *now = of(e, r->now, *vertex);
    for (int c = 0; c < e->width; c++)
        kept_real(k, &now[c], -KEPT_FAR_MM, KEPT_FAR_MM);
    if (!k->reads)
        return;
    r->is_pending[*vertex] = true;
    displace(e, r->displacement, *vertex, now);
}

void easing_keep(struct easing *e, const struct operation *operation, int tissue, struct kept *k) {
    bool own = e->room;
    kept_flag(k, &own);
    if (!own || k->bad)
        return;
    if (k->reads)
        settle(e, operation, tissue);
    struct easing_room *r = e->room;
    kept_count(k, &r->pending_count, e->group->mesh.vertex_count);
    for (uint32_t i = 0; i < r->pending_count && !k->bad; i++)
        keep_pending(e, i, k);
    if (k->reads)
        update(r, r->pending_count);
}
