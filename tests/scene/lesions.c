#include "scene/lesions.h"

#include "generate/deform.h"
#include "check/inspect.h"
#include "match/match.h"
#include "mesh/query.h"
#include "random.h"

#include <stdlib.h>
#include <string.h>

#define PLACE_MM 3.0
#define SIZE_SHARE 0.1
#define ROOM_MM 4.0 // above a bump, free of all other groups

const char *lesion_name(enum lesion lesion) {
    static const char *const names[LESION_COUNT] = {"cavity", "cavity under meniscus", "bump",
                                                    "trimmed meniscus", "notch osteophyte"};
    return names[lesion];
}

bool lesion_is_concave(enum lesion lesion) {
    return lesion != LESION_CAVITY;
}

static struct deform_cavity vary(vec3 at, double radius_mm, double depth_mm, struct random *r) {
    double size = random_between(r, 1 - SIZE_SHARE, 1 + SIZE_SHARE);
    vec3 beside = {random_between(r, -PLACE_MM, PLACE_MM), random_between(r, -PLACE_MM, PLACE_MM),
                   0};
    return (struct deform_cavity){vec3_add(at, beside), size * radius_mm, size * depth_mm};
}

// ---- cavities -----------------------------------------------------------------------------------

static enum result need_medial(struct knee_case *knee, struct case_group **out_meniscus,
                               vec3 *out_plateau, struct error *err) {
    *out_meniscus = case_group(knee, "meniscus_medial");
    if (!*out_meniscus)
        return fail(err, RESULT_MISSING, "case %s has no meniscus_medial", knee->name);
    if (!inspect_medial_plateau(knee, out_plateau))
        return fail(err, RESULT_MISSING, "case %s has no medial plateau", knee->name);
    return RESULT_OK;
}

static enum result add_cavity(struct knee_case *knee, struct case_group *meniscus, vec3 at,
                              struct random *r, struct error *err) {
    struct case_group *groups[2] = {case_group(knee, "tibia"), meniscus};
    struct deform_cavity cavity = vary(at, 9, 3, r);
    return deform_cavity_add(groups, 2, &cavity, err);
}

static enum result make_exposed(struct knee_case *knee, struct random *r, struct error *err) {
    struct case_group *meniscus;
    vec3 plateau;
    enum result result = need_medial(knee, &meniscus, &plateau, err);
    vec3 at = vec3_add(plateau, (vec3){0, 5, 0});
    return result == RESULT_OK ? add_cavity(knee, meniscus, at, r, err) : result;
}

// Below the middle of the meniscus's body, beside the plateau's middle.
static enum result make_under_meniscus(struct knee_case *knee, struct random *r,
                                       struct error *err) {
    struct case_group *meniscus;
    vec3 plateau, sum = {0};
    int count = 0;
    enum result result = need_medial(knee, &meniscus, &plateau, err);
    if (result != RESULT_OK)
        return result;
    double medial = inspect_joint_centre(knee).x < plateau.x ? 1 : -1;
    for (uint32_t v = 0; v < meniscus->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&meniscus->mesh, v);
        if (fabs(p.y - plateau.y) > 3 || medial * (p.x - plateau.x) < 0)
            continue;
        sum = vec3_add(sum, p);
        count++;
    }
    if (!count)
        return fail(err, RESULT_MISSING, "case %s: no meniscus beside the medial plateau",
                    knee->name);
    return add_cavity(knee, meniscus, vec3_scale(1.0 / count, sum), r, err);
}

// ---- bumps --------------------------------------------------------------------------------------

static enum result add_bump(struct case_group *group, const struct deform_cavity *bump,
                            struct error *err) {
    enum result result = deform_cavity_add(&group, 1, bump, err);
    for (size_t i = 0; result == RESULT_OK && i < 3 * (size_t)group->mesh.vertex_count; i++)
        group->warp[i] = -group->warp[i];
    return result;
}

static bool is_free(const struct knee_case *knee, struct query *const queries[], int group,
                    vec3 p) {
    struct closest c;
    for (int i = 0; i < knee->group_count; i++)
        if (i != group && query_closest(queries[i], p, ROOM_MM, MESH_NONE, &c))
            return false;
    return true;
}

static vec3 face_normal(const struct mesh *mesh, uint32_t t) {
    vec3 a = mesh_corner(mesh, t, 0);
    return vec3_unit_or(
        vec3_cross(vec3_sub(mesh_corner(mesh, t, 1), a), vec3_sub(mesh_corner(mesh, t, 2), a)),
        (vec3){0});
}

// The place of the group nearest to `wanted` with room above it.
static bool find_room(const struct knee_case *knee, struct query *const queries[], int group,
                      vec3 wanted, vec3 *out_place) {
    const struct mesh *mesh = &knee->groups[group].mesh;
    double nearest = INFINITY;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 p = mesh_corner(mesh, t, 0);
        double distance = vec3_distance(p, wanted);
        if (distance >= nearest ||
            !is_free(knee, queries, group, vec3_add_scaled(p, ROOM_MM, face_normal(mesh, t))))
            continue;
        nearest = distance;
        *out_place = p;
    }
    return isfinite(nearest);
}

static enum result make_bump(struct knee_case *knee, struct random *r, struct error *err) {
    struct query *queries[CASE_GROUPS_MAX] = {0};
    struct case_group *femur = case_group(knee, "femur"), *meniscus;
    vec3 plateau, place;
    enum result result = need_medial(knee, &meniscus, &plateau, err);
    for (int i = 0; result == RESULT_OK && i < knee->group_count; i++)
        result = query_create(&knee->groups[i].mesh, &queries[i], err);
    if (result == RESULT_OK &&
        !find_room(knee, queries, (int)(femur - knee->groups), plateau, &place))
        result = fail(err, RESULT_MISSING, "case %s: no room on the femur", knee->name);
    for (int i = 0; i < knee->group_count; i++)
        query_destroy(&queries[i]);
    if (result != RESULT_OK)
        return result;
    struct deform_cavity bump = vary(place, 7, 1.5, r);
    return add_bump(femur, &bump, err);
}

// Between the condyles, straight above the middle of the plateau.
static enum result make_notch(struct knee_case *knee, struct random *r, struct error *err) {
    struct case_group *femur = case_group(knee, "femur"), *meniscus;
    vec3 plateau, roof = {0, 0, INFINITY};
    enum result result = need_medial(knee, &meniscus, &plateau, err);
    if (result != RESULT_OK)
        return result;
    double middle = inspect_joint_centre(knee).x;
    for (uint32_t v = 0; v < femur->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&femur->mesh, v);
        if (fabs(p.x - middle) < 2 && fabs(p.y - plateau.y) < 4 && p.z < roof.z)
            roof = p;
    }
    if (!isfinite(roof.z))
        return fail(err, RESULT_MISSING, "case %s: no notch above the plateau", knee->name);
    struct deform_cavity bump = vary(roof, 6, 2, r);
    return add_bump(femur, &bump, err);
}

// ---- the meniscus -------------------------------------------------------------------------------

#define TRIMMED_SHARE 0.3 // of what may be cut
#define BITE_MM 6.0

// Somewhere in the inner margin, which has far to go.
static uint32_t margin_vertex(const struct case_group *group, struct random *r) {
    double longest = inspect_largest(group, group->maxcut);
    for (;;) {
        uint32_t v = (uint32_t)(random_bits(r) % group->mesh.vertex_count);
        const float *m = group->maxcut + 3 * (size_t)v;
        if (vec3_length((vec3){(double)m[0], (double)m[1], (double)m[2]}) > 0.7 * longest)
            return v;
    }
}

static enum result make_trimmed(struct knee_case *knee, struct random *r, struct error *err) {
    struct case_group *group = case_group(knee, "meniscus_medial");
    if (!group || !group->maxcut)
        return fail(err, RESULT_MISSING, "case %s has no meniscus_medial with a maxcut",
                    knee->name);
    struct match_surface *surface = match_surface_create(&group->mesh, NULL, group->maxcut);
    struct match *match = match_create(surface);
    double whole = match_surface_volume(surface), least = match_surface_least(surface);
    double share = TRIMMED_SHARE * random_between(r, 1 - SIZE_SHARE, 1 + SIZE_SHARE);
    struct brush bite = {match_vertex(match, margin_vertex(group, r)), BITE_MM};
    struct match_report report;
    match_to_volume(match, &bite, 1, whole - share * (whole - least), &report);
    float *warp = case_group_need_warp(group);
    for (size_t i = 0; i < 3 * (size_t)group->mesh.vertex_count; i++)
        warp[i] = (float)match_blends(match)[i / 3] * group->maxcut[i];
    match_destroy(&match);
    match_surface_destroy(&surface);
    return RESULT_OK;
}

enum result lesion_make(struct knee_case *knee, enum lesion lesion, uint64_t seed,
                        struct error *err) {
    static enum result (*const make[LESION_COUNT])(struct knee_case *, struct random *,
                                                   struct error *) = {
        make_exposed, make_under_meniscus, make_bump, make_trimmed, make_notch};
    struct random r = {seed};
    for (int i = 0; i < knee->group_count; i++) {
        free(knee->groups[i].warp);
        knee->groups[i].warp = NULL;
    }
    return make[lesion](knee, &r, err);
}
