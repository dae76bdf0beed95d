#include "step/easing.h"

#include "base/check.h"
#include "step/settings.h"

#include <stdlib.h>
#include <string.h>

struct easing {
    const struct case_group *group;
    float *displacement;
    struct surface_mean *mean;
    struct surface_integral *integral;
    float *aimed;                   // the displacement when all is eased in; NULL without integral
    struct surface_integral *whole; // of it
    const struct query *query;
    int width;            // numbers for each vertex, as in struct touch_change
    double *now, *target; // of all vertices
    uint32_t *pending;    // vertices that are not yet at the target
    bool *is_pending;
    uint32_t pending_count;
};

struct easing *easing_create(const struct scene *scene, int tissue, const struct field *field,
                             int rules) {
    int index = scene->tissues[tissue].group;
    const struct case_group *group = &scene->knee->groups[index];
    size_t count = group->mesh.vertex_count;
    struct easing *e = alloc(1, sizeof *e);
    e->group = group;
    e->displacement = alloc(3 * count, sizeof *e->displacement);
    e->width = rules >= RULES_TOUCH_FITTED ? 3 : 1;
    e->now = alloc((size_t)e->width * count, sizeof *e->now);
    e->target = alloc((size_t)e->width * count, sizeof *e->target);
    e->pending = alloc(count, sizeof *e->pending);
    e->is_pending = alloc(count, sizeof *e->is_pending);
    easing_restore(e);
    if (field->kind == FIELD_SMOOTH && !group->bridges)
        e->mean = surface_mean_create(scene->trees[index], e->displacement);
    e->query = scene->queries[index];
    if (field->kind == FIELD_INTEGRAL && !group->bridges) {
        e->aimed = alloc(3 * count, sizeof *e->aimed);
        memcpy(e->aimed, e->displacement, 3 * count * sizeof *e->aimed);
        e->integral = surface_integral_create(scene->blocks[index], e->displacement);
        e->whole = surface_integral_create(scene->blocks[index], e->aimed);
    }
    return e;
}

void easing_destroy(struct easing **easing) {
    struct easing *e = *easing;
    if (!e)
        return;
    surface_mean_destroy(&e->mean);
    surface_integral_destroy(&e->integral);
    surface_integral_destroy(&e->whole);
    free(e->aimed);
    free(e->displacement);
    free(e->now);
    free(e->target);
    free(e->pending);
    free(e->is_pending);
    free(e);
    *easing = NULL;
}

const float *easing_displacement(const struct easing *easing) {
    return easing->displacement;
}

const struct surface_mean *easing_mean(const struct easing *easing) {
    return easing->mean;
}

static double *of(const struct easing *e, double *values, uint32_t vertex) {
    return values + (size_t)e->width * vertex;
}

static bool is_moved(const struct easing *e, uint32_t vertex) {
    const double *now = of(e, e->now, vertex);
    for (int i = 0; i < e->width; i++)
        if (now[i] != 0)
            return true;
    return false;
}

const struct surface_integral *easing_integral(const struct easing *easing) {
    return easing->integral;
}

static void update(struct easing *e, uint32_t changed) {
    if (e->mean)
        surface_mean_update(e->mean, e->pending, changed);
    if (e->integral)
        surface_integral_update(e->integral, e->pending, changed);
}

void easing_restore(struct easing *e) {
    size_t count = e->group->mesh.vertex_count;
    uint32_t changed = 0;
    for (uint32_t v = 0; v < count; v++)
        if (is_moved(e, v) || e->is_pending[v])
            e->pending[changed++] = v;
    memset(e->now, 0, (size_t)e->width * count * sizeof *e->now);
    memset(e->target, 0, (size_t)e->width * count * sizeof *e->target);
    memset(e->is_pending, 0, count * sizeof *e->is_pending);
    e->pending_count = 0;
    for (size_t i = 0; i < 3 * count; i++)
        e->displacement[i] = e->group->warp ? e->group->warp[i] : 0;
    update(e, changed);
    if (!e->whole)
        return;
    memcpy(e->aimed, e->displacement, 3 * count * sizeof *e->aimed);
    surface_integral_update(e->whole, e->pending, changed);
}

static void displace(const struct easing *e, float *displacement, uint32_t vertex,
                     const double *offset) {
    for (size_t k = 0; k < 3; k++) {
        size_t i = 3 * (size_t)vertex + k;
        double warp = e->group->warp ? (double)e->group->warp[i] : 0;
        double by = e->width == 3 ? offset[k] : *offset * (double)e->group->maxcut[i];
        displacement[i] = (float)(warp + by);
    }
}

void easing_aim(struct easing *e, const struct touch_change *touch) {
    size_t size = (size_t)e->width * sizeof(double);
    CHECK(!touch->count || touch->width == e->width);
    for (uint32_t i = 0; i < touch->count; i++) {
        uint32_t vertex = touch->vertices[i];
        CHECK(vertex < e->group->mesh.vertex_count);
        memcpy(of(e, e->target, vertex), touch->values + (size_t)e->width * i, size);
        if (e->aimed)
            displace(e, e->aimed, vertex, of(e, e->target, vertex));
        if (e->is_pending[vertex] || !memcmp(of(e, e->now, vertex), of(e, e->target, vertex), size))
            continue;
        e->pending[e->pending_count++] = vertex;
        e->is_pending[vertex] = true;
    }
    if (e->whole)
        surface_integral_update(e->whole, touch->vertices, touch->count);
}

bool easing_active(const struct easing *easing) {
    return easing->pending_count > 0;
}

static double rest_at(const struct easing *e, uint32_t vertex) {
    const double *now = of(e, e->now, vertex), *target = of(e, e->target, vertex);
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
    struct closest c;
    struct surface_sight now, whole;
    if (triangle == MESH_NONE)
        return 0;
    if (e->mean)
        return rest_of(e, e->pending, e->pending_count);
    if (e->integral && query_closest(e->query, p, INFINITY, triangle, &c) &&
        surface_integral_at(e->integral, p, c.point, &now) &&
        surface_integral_at(e->whole, p, c.point, &whole))
        return vec3_distance(now.displacement, whole.displacement);
    return rest_of(e, e->group->mesh.triangles + 3 * (size_t)triangle, 3);
}

void easing_advance(struct easing *e, double share) {
    for (uint32_t i = 0; i < e->pending_count; i++) {
        uint32_t vertex = e->pending[i];
        double *now = of(e, e->now, vertex);
        const double *target = of(e, e->target, vertex);
        for (int k = 0; k < e->width; k++)
            now[k] = share < 1 ? now[k] + share * (target[k] - now[k]) : target[k];
        displace(e, e->displacement, vertex, now);
        e->is_pending[vertex] = share < 1;
    }
    update(e, e->pending_count);
    if (share >= 1)
        e->pending_count = 0;
}
