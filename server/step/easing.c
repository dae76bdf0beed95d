#include "step/easing.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

struct easing {
    const struct case_group *group;
    float *displacement;
    struct surface_mean *mean;
    double *blend, *target; // one for each vertex
    uint32_t *pending;      // vertices whose blend is not yet the target
    bool *is_pending;
    uint32_t pending_count;
};

struct easing *easing_create(const struct scene *scene, int tissue, const struct field *field) {
    int index = scene->tissues[tissue].group;
    const struct case_group *group = &scene->knee->groups[index];
    size_t count = group->mesh.vertex_count;
    struct easing *e = alloc(1, sizeof *e);
    e->group = group;
    e->displacement = alloc(3 * count, sizeof *e->displacement);
    e->blend = alloc(count, sizeof *e->blend);
    e->target = alloc(count, sizeof *e->target);
    e->pending = alloc(count, sizeof *e->pending);
    e->is_pending = alloc(count, sizeof *e->is_pending);
    easing_restore(e);
    if (field->kind == FIELD_SMOOTH && !group->bridges)
        e->mean = surface_mean_create(scene->trees[index], e->displacement);
    return e;
}

void easing_destroy(struct easing **easing) {
    struct easing *e = *easing;
    if (!e)
        return;
    surface_mean_destroy(&e->mean);
    free(e->displacement);
    free(e->blend);
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

void easing_restore(struct easing *e) {
    size_t count = e->group->mesh.vertex_count;
    uint32_t changed = 0;
    for (uint32_t v = 0; v < count; v++)
        if (e->blend[v] != 0)
            e->pending[changed++] = v;
    memset(e->blend, 0, count * sizeof *e->blend);
    memset(e->target, 0, count * sizeof *e->target);
    memset(e->is_pending, 0, count * sizeof *e->is_pending);
    e->pending_count = 0;
    for (size_t i = 0; i < 3 * count; i++)
        e->displacement[i] = e->group->warp ? e->group->warp[i] : 0;
    if (e->mean)
        surface_mean_update(e->mean, e->pending, changed);
}

void easing_aim(struct easing *e, const struct job_result *result) {
    for (uint32_t i = 0; i < result->blend_count; i++) {
        uint32_t vertex = result->vertices[i];
        CHECK(vertex < e->group->mesh.vertex_count);
        e->target[vertex] = result->blends[i];
        if (e->is_pending[vertex] || e->blend[vertex] == e->target[vertex])
            continue;
        e->pending[e->pending_count++] = vertex;
        e->is_pending[vertex] = true;
    }
}

bool easing_active(const struct easing *easing) {
    return easing->pending_count > 0;
}

static double rest_of(const struct easing *e, const uint32_t *vertices, uint32_t count) {
    double largest = 0;
    for (uint32_t i = 0; i < count; i++) {
        const float *to = e->group->maxcut + 3 * (size_t)vertices[i];
        double reach = vec3_length((vec3){(double)to[0], (double)to[1], (double)to[2]});
        largest = fmax(largest, reach * fabs(e->target[vertices[i]] - e->blend[vertices[i]]));
    }
    return largest;
}

double easing_rest_mm(const struct easing *e, uint32_t triangle) {
    if (triangle == MESH_NONE)
        return 0;
    return e->mean ? rest_of(e, e->pending, e->pending_count)
                   : rest_of(e, e->group->mesh.triangles + 3 * (size_t)triangle, 3);
}

static void displace(struct easing *e, uint32_t vertex) {
    for (size_t i = 3 * (size_t)vertex; i < 3 * (size_t)vertex + 3; i++) {
        double warp = e->group->warp ? (double)e->group->warp[i] : 0;
        e->displacement[i] = (float)(warp + e->blend[vertex] * (double)e->group->maxcut[i]);
    }
}

void easing_advance(struct easing *e, double share) {
    for (uint32_t i = 0; i < e->pending_count; i++) {
        uint32_t vertex = e->pending[i];
        e->blend[vertex] = share < 1
                               ? e->blend[vertex] + share * (e->target[vertex] - e->blend[vertex])
                               : e->target[vertex];
        displace(e, vertex);
        e->is_pending[vertex] = share < 1;
    }
    if (e->mean)
        surface_mean_update(e->mean, e->pending, e->pending_count);
    if (share >= 1)
        e->pending_count = 0;
}
