#include "generate/deform.h"

#include "base/check.h"
#include "generate/refine.h"

// 1 in the middle, 0 from the radius on. Its steepest slope is 1.72 / radius: the map stays one to
// one while depth < 0.58 radius.
static double falloff(double distance, double radius) {
    double t = fmin(distance / radius, 1), s = 1 - t * t;
    return s * s * s;
}

static vec3 displaced_vertex(const struct case_group *group, uint32_t vertex) {
    vec3 p = mesh_vertex(&group->mesh, vertex);
    const float *w = group->warp ? group->warp + 3 * (size_t)vertex : NULL;
    return w ? vec3_add(p, (vec3){(double)w[0], (double)w[1], (double)w[2]}) : p;
}

// Twice its area, outwards.
static vec3 triangle_normal(const struct mesh *mesh, uint32_t triangle) {
    vec3 a = mesh_corner(mesh, triangle, 0);
    return vec3_cross(vec3_sub(mesh_corner(mesh, triangle, 1), a),
                      vec3_sub(mesh_corner(mesh, triangle, 2), a));
}

static bool has_corner(const struct mesh *mesh, uint32_t triangle, uint32_t vertex) {
    const uint32_t *corners = mesh->triangles + 3 * (size_t)triangle;
    return corners[0] == vertex || corners[1] == vertex || corners[2] == vertex;
}

// The scan's steps tilt a single vertex's normal by 10 degrees and more.
static vec3 surface_normal(const struct mesh *mesh, uint32_t vertex, double radius) {
    vec3 own = {0}, mean = {0}, middle = mesh_vertex(mesh, vertex);
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        if (has_corner(mesh, t, vertex))
            own = vec3_add(own, triangle_normal(mesh, t));
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 normal = triangle_normal(mesh, t);
        bool near = true;
        for (int i = 0; i < 3; i++)
            near = near && vec3_distance(mesh_corner(mesh, t, i), middle) < radius;
        if (near && vec3_dot(normal, own) > 0)
            mean = vec3_add(mean, normal);
    }
    return vec3_unit_or(vec3_add(own, mean), (vec3){0});
}

static enum result check_cavity(const struct deform_cavity *cavity, struct error *err) {
    if (!vec3_is_finite(cavity->at))
        return fail(err, RESULT_INVALID, "cavity: its point is not finite");
    if (!(cavity->radius_mm >= 0.5 && cavity->radius_mm <= 100))
        return fail(err, RESULT_INVALID, "cavity: radius %g is not within 0.5 and 100 mm",
                    cavity->radius_mm);
    if (!(cavity->depth_mm > 0 && cavity->depth_mm <= cavity->radius_mm / 2))
        return fail(err, RESULT_INVALID,
                    "cavity: depth %g is not above 0 and at most half of its radius %g: the "
                    "surface would fold",
                    cavity->depth_mm, cavity->radius_mm);
    return RESULT_OK;
}

struct dent {
    vec3 middle, normal;
    const struct deform_cavity *cavity;
};

static vec3 dent_at(const void *context, vec3 p) {
    const struct dent *dent = context;
    double share = falloff(vec3_distance(p, dent->middle), dent->cavity->radius_mm);
    return vec3_scale(-dent->cavity->depth_mm * share, dent->normal);
}

static void make_dent(struct case_group *group, const struct dent *dent) {
    struct refine_map map = {dent_at, dent, dent->middle, dent->cavity->radius_mm};
    if (dent->cavity->refines)
        refine_group(group, &map);
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        vec3 p = displaced_vertex(group, v);
        if (vec3_distance(p, dent->middle) >= dent->cavity->radius_mm)
            continue;
        vec3 by = dent_at(dent, p);
        float *warp = case_group_need_warp(group) + 3 * (size_t)v;
        warp[0] += (float)by.x;
        warp[1] += (float)by.y;
        warp[2] += (float)by.z;
    }
}

enum result deform_cavity_add(struct case_group *const *groups, int group_count,
                              const struct deform_cavity *cavity, struct error *err) {
    CHECK(group_count > 0 && groups[0]->part_count > 0);
    enum result result = check_cavity(cavity, err);
    if (result != RESULT_OK)
        return result;
    const struct mesh *mesh = &groups[0]->mesh;
    uint32_t vertex = mesh_nearest_vertex(mesh, cavity->at);
    double distance = vec3_distance(mesh_vertex(mesh, vertex), cavity->at);
    if (distance > cavity->radius_mm / 2)
        return fail(err, RESULT_INVALID,
                    "cavity at %g,%g,%g: the nearest vertex of %s is %.1f mm away, more than half "
                    "of the radius",
                    cavity->at.x, cavity->at.y, cavity->at.z, groups[0]->name, distance);
    vec3 normal = surface_normal(mesh, vertex, cavity->radius_mm / 4);
    if (vec3_length(normal) == 0)
        return fail(err, RESULT_INVALID, "cavity: %s has no normal at vertex %u", groups[0]->name,
                    vertex);
    struct dent dent = {displaced_vertex(groups[0], vertex), normal, cavity};
    for (int i = 0; i < group_count; i++)
        make_dent(groups[i], &dent);
    return RESULT_OK;
}
