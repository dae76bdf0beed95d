#include "generate/generate.h"

#include "base/check.h"
#include "generate/bridge.h"
#include "generate/maxcut.h"
#include "generate/shape.h"
#include "generate/tube.h"
#include "mesh/query.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double patella_gap = 0.5;
static const int patella_step_deg = 5;

// From the right knee of size 1 to the recipe's.
static vec3 to_patient(const struct recipe *recipe, vec3 p) {
    double mirror = recipe->side == SIDE_LEFT ? -1 : 1;
    return vec3_scale(recipe->size, (vec3){mirror * p.x, p.y, p.z});
}

static pose pose_to_patient(const struct recipe *recipe, pose p) {
    double mirror = recipe->side == SIDE_LEFT ? -1 : 1;
    quat q = p.rotation;
    return (pose){{q.w, q.x, mirror * q.y, mirror * q.z}, to_patient(recipe, p.translation)};
}

static void mesh_to_patient(const struct recipe *recipe, struct mesh *mesh) {
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(mesh, v, to_patient(recipe, mesh_vertex(mesh, v)));
    if (recipe->side == SIDE_RIGHT)
        return;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t *corner = mesh->triangles + 3 * t, first = corner[0];
        corner[0] = corner[1];
        corner[1] = first;
    }
}

// Takes the mesh of the right knee of size 1 over as a group of one part.
static struct case_group *add_recipe_group(struct knee_case *knee, const struct recipe *recipe,
                                           const char *name, enum body body, struct mesh *mesh) {
    mesh_to_patient(recipe, mesh);
    struct case_group *group = case_add_group(knee, name, body);
    CHECK(group);
    struct error err;
    enum result result = case_add_part(group, name, mesh, &err);
    CHECK(result == RESULT_OK);
    mesh_fini(mesh);
    return group;
}

// The patella's frame coincides with the femur's at flexion 0, as those of all bodies do.
static void add_patella(struct knee_case *knee, const struct recipe *recipe, double edge) {
    struct mesh mesh;
    implicit_mesh(shape_patella, shape_patella_box(), edge, &mesh);
    pose rest = shape_patella_pose(&mesh, 0, patella_gap);
    for (int flexion = 0; flexion <= SHAPE_FLEXION_MAX; flexion += patella_step_deg) {
        pose there = shape_patella_pose(&mesh, flexion, patella_gap);
        pose path = pose_compose(there, pose_inverse(rest));
        knee->patella_keys[knee->patella_key_count++] =
            (struct patella_key){flexion, pose_to_patient(recipe, path)};
    }
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh_set_vertex(&mesh, v, pose_apply(rest, mesh_vertex(&mesh, v)));
    add_recipe_group(knee, recipe, "patella", BODY_PATELLA, &mesh);
}

static void add_bones(struct knee_case *knee, const struct recipe *recipe, double edge) {
    struct mesh mesh;
    implicit_mesh(shape_femur, shape_femur_box(), edge, &mesh);
    add_recipe_group(knee, recipe, "femur", BODY_FEMUR, &mesh);
    implicit_mesh(shape_tibia, shape_tibia_box(), edge, &mesh);
    add_recipe_group(knee, recipe, "tibia", BODY_TIBIA, &mesh);
    add_patella(knee, recipe, 0.7 * edge);
}

static enum result add_menisci(struct knee_case *knee, const struct recipe *recipe, double edge,
                               struct error *err) {
    static const char *const names[] = {"meniscus_medial", "meniscus_lateral"};
    double cm3[] = {recipe->meniscus_medial_cm3, recipe->meniscus_lateral_cm3};
    for (int i = 0; i < 2; i++) {
        struct mesh mesh;
        bool reached = tube_meniscus(i == 1, 1000 * cm3[i], edge / 2, &mesh);
        add_recipe_group(knee, recipe, names[i], BODY_TIBIA, &mesh)->cuttable = true;
        if (!reached)
            return fail(err, RESULT_INVALID, "%s: %g cm3 do not fit under the femur", names[i],
                        cm3[i]);
    }
    return RESULT_OK;
}

static enum result add_ligaments(struct knee_case *knee, const struct recipe *recipe, double edge,
                                 struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < LIGAMENT_COUNT && result == RESULT_OK; i++) {
        struct mesh mesh;
        tube_ligament(&ligaments[i], edge / 2, &mesh);
        struct case_group *group =
            add_recipe_group(knee, recipe, ligaments[i].name, BODY_TIBIA, &mesh);
        result = bridge_make(knee, group, BODY_FEMUR, err);
    }
    return result;
}

// Beside the patellar tendon, at the joint line: the skin's point in front of (x, z).
static void add_portals(struct knee_case *knee, const struct recipe *recipe,
                        const struct query *skin) {
    static const struct {
        const char *name;
        vec3 before, towards;
    } portals[] = {{"anterolateral", {20, 60, -23}, {5, 8, -19}},
                   {"anteromedial", {-20, 60, -23}, {-5, 8, -19}}};
    for (int i = 0; i < 2; i++) {
        struct case_portal *portal = &knee->portals[knee->portal_count++];
        struct closest closest;
        bool found = query_closest(skin, to_patient(recipe, portals[i].before), INFINITY, MESH_NONE,
                                   &closest);
        CHECK(found);
        vec3 inward = vec3_sub(to_patient(recipe, portals[i].towards), closest.point);
        snprintf(portal->name, sizeof portal->name, "%s", portals[i].name);
        portal->position = closest.point;
        portal->direction = vec3_unit_or(inward, (vec3){0, -1, 0});
    }
}

static enum result add_skin(struct knee_case *knee, const struct recipe *recipe, double edge,
                            struct error *err) {
    struct mesh mesh;
    implicit_mesh(shape_skin, shape_skin_box(), 2 * edge, &mesh);
    struct case_group *group = add_recipe_group(knee, recipe, "skin", BODY_FEMUR, &mesh);
    struct query *query;
    enum result result = query_create(&group->mesh, &query, err);
    if (result != RESULT_OK)
        return result;
    add_portals(knee, recipe, query);
    query_destroy(&query);
    return bridge_make(knee, group, BODY_TIBIA, err);
}

static enum result add_maxcut(struct knee_case *knee, const struct recipe *recipe,
                              struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < knee->group_count && recipe->rim_mm > 0 && result == RESULT_OK; i++)
        if (knee->groups[i].cuttable)
            result = maxcut_make(&knee->groups[i], knee->joint.T_tibia_joint, recipe->rim_mm, err);
    return result;
}

static enum result add_steps(struct knee_case *knee, const struct recipe *recipe,
                             enum pathology_kind kind, struct error *err) {
    for (int i = 0; i < recipe->step_count; i++) {
        struct pathology step = recipe->steps[i];
        if (step.kind != kind)
            continue;
        if (kind == PATHOLOGY_CAVITY)
            step.cavity.place.at = vec3_scale(recipe->size, step.cavity.place.at);
        if (kind == PATHOLOGY_WEAR)
            step.wear.place.at = vec3_scale(recipe->size, step.wear.place.at);
        if (kind == PATHOLOGY_LOOSE)
            step.loose.at = vec3_scale(recipe->size, step.loose.at);
        for (int k = 0; kind == PATHOLOGY_TISSUE && k < step.tissue.path_count; k++)
            step.tissue.path[k] = vec3_scale(recipe->size, step.tissue.path[k]);
        enum result result = pathology_apply(knee, &step, recipe->rim_mm, err);
        if (result != RESULT_OK)
            return fail_in(err, result, "[%s %s] ", pathology_kind_name(kind), step.name);
    }
    return RESULT_OK;
}

enum result generate_knee(const struct recipe *recipe, struct knee_case **out_case,
                          struct error *err) {
    struct knee_case *knee = case_create(recipe->name, recipe->title);
    double edge = recipe->resolution_mm / recipe->size;
    knee->joint = (struct joint_frame){recipe->side, pose_identity(), pose_identity()};
    add_bones(knee, recipe, edge);
    enum result result = add_menisci(knee, recipe, edge, err);
    if (result == RESULT_OK)
        result = add_ligaments(knee, recipe, edge, err);
    if (result == RESULT_OK)
        result = add_skin(knee, recipe, edge, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_LIGAMENT, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_CAVITY, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_WEAR, err);
    if (result == RESULT_OK)
        result = add_maxcut(knee, recipe, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_TEAR, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_PLAN, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_TISSUE, err);
    if (result == RESULT_OK)
        result = add_steps(knee, recipe, PATHOLOGY_LOOSE, err);
    if (result != RESULT_OK)
        case_destroy(&knee);
    *out_case = knee;
    return result;
}
