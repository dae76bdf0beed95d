#include "case/generate_cavity.h"

#include "base/check.h"
#include "mesh/query.h"

struct dent {
    vec3 centre, inward;
    double radius, depth;
};

// 1 in the middle, 0 from the radius on; steepest 1.72 / radius, so that p + depth inward falloff
// is one to one while depth <= radius / 2.
static double falloff(double distance, double radius) {
    double t = fmin(distance / radius, 1), s = 1 - t * t;
    return s * s * s;
}

// Inward is against the mean normal of the surface within the radius.
static vec3 inward_of(const struct mesh *mesh, vec3 centre, double radius) {
    vec3 sum = {0};
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0), b = mesh_corner(mesh, t, 1), c = mesh_corner(mesh, t, 2);
        vec3 normal = vec3_cross(vec3_sub(b, a), vec3_sub(c, a));
        vec3 middle = vec3_scale(1.0 / 3, vec3_add(a, vec3_add(b, c)));
        sum = vec3_add_scaled(sum, -falloff(vec3_distance(middle, centre), radius), normal);
    }
    return vec3_unit_or(sum, (vec3){0, 0, -1});
}

static enum result place_dent(struct knee_case *knee, const struct cavity *cavity,
                              struct dent *out_dent, struct error *err) {
    const struct case_group *bone = case_group(knee, body_name(cavity->body));
    CHECK(bone && cavity->depth_mm <= cavity->radius_mm / 2);
    struct query *query;
    enum result result = query_create(&bone->mesh, &query, err);
    if (result != RESULT_OK)
        return result;
    struct closest closest;
    bool near = query_closest(query, cavity->at, cavity->radius_mm / 2, MESH_NONE, &closest);
    query_destroy(&query);
    if (!near)
        return fail(err, RESULT_INVALID,
                    "[cavity %s] at: the surface of the %s is farther away than half of radius_mm",
                    cavity->name, bone->name);
    *out_dent = (struct dent){.centre = closest.point,
                              .inward = inward_of(&bone->mesh, closest.point, cavity->radius_mm),
                              .radius = cavity->radius_mm,
                              .depth = cavity->depth_mm};
    return RESULT_OK;
}

static void dent_group(struct case_group *group, const struct dent *dent) {
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        float *warp = group->warp ? group->warp + 3 * (size_t)v : NULL;
        vec3 p = mesh_vertex(&group->mesh, v);
        if (warp)
            p = vec3_add(p, (vec3){(double)warp[0], (double)warp[1], (double)warp[2]});
        double depth = dent->depth * falloff(vec3_distance(p, dent->centre), dent->radius);
        if (depth == 0)
            continue;
        warp = case_group_need_warp(group) + 3 * (size_t)v;
        warp[0] += (float)(depth * dent->inward.x);
        warp[1] += (float)(depth * dent->inward.y);
        warp[2] += (float)(depth * dent->inward.z);
    }
}

enum result cavity_add(struct knee_case *knee, const struct cavity *cavity, struct error *err) {
    struct dent dent = {0};
    enum result result = place_dent(knee, cavity, &dent, err);
    if (result != RESULT_OK)
        return result;
    for (int g = 0; g < knee->group_count; g++)
        if (knee->groups[g].body == cavity->body)
            dent_group(&knee->groups[g], &dent);
    return RESULT_OK;
}
