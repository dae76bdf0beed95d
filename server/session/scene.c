#include "session/scene.h"

#include "base/check.h"

#include <stdlib.h>

// ---- tissue -------------------------------------------------------------------------------------

// S + warp, or S + warp + maxcut.
static void displaced(const struct case_group *group, bool cut, struct mesh *out_mesh) {
    mesh_copy(out_mesh, &group->mesh);
    for (size_t i = 0; i < 3 * (size_t)out_mesh->vertex_count; i++) {
        if (group->warp)
            out_mesh->positions[i] += group->warp[i];
        if (cut)
            out_mesh->positions[i] += group->maxcut[i];
    }
}

// In parts, as many as one cut takes.
static enum result tear(struct cut_mesh *mesh, const struct case_region *region,
                        struct error *err) {
    for (int i = 0; i < region->part_count; i += CUT_PARTS_MAX) {
        int count = region->part_count - i < CUT_PARTS_MAX ? region->part_count - i : CUT_PARTS_MAX;
        struct cut_change change = {0};
        if (cut_apply(mesh, region->parts + i, count, &change, err) == CUT_REFUSED)
            return fail_in(err, RESULT_INVALID, "the tear cannot be cut: ");
        cut_change_fini(&change);
    }
    return RESULT_OK;
}

static struct quality_plan *plan_of(const struct knee_case *knee, const struct case_group *group,
                                    const struct mesh *whole) {
    struct mesh least = {0};
    if (group->maxcut)
        displaced(group, true, &least);
    // The groups' frames coincide with the femur's in the rest pose, whose axes are the knee's.
    quat axes = knee->joint.T_femur_joint.rotation;
    const struct case_lesion *lesion = &group->lesion;
    struct quality_setting setting = {
        .tissue = whole,
        .least = group->maxcut ? &least : NULL,
        .up = quat_rotate(axes, (vec3){0, 0, 1}),
        .anterior = quat_rotate(axes, (vec3){0, 1, 0}),
        .plan = lesion->plan.parts,
        .plan_count = lesion->plan.part_count,
        .damage = lesion->damage.parts,
        .damage_count = lesion->damage.part_count,
    };
    struct quality_plan *plan = quality_plan_create(&setting);
    mesh_fini(&least);
    return plan;
}

static enum result add_tissue(struct scene *scene, int index, struct error *err) {
    const struct case_group *group = &scene->knee->groups[index];
    if (scene->tissue_count == TISSUES_MAX)
        return fail(err, RESULT_LIMIT, "more than %d groups are cuttable", TISSUES_MAX);
    struct scene_tissue *tissue = &scene->tissues[scene->tissue_count++];
    struct mesh whole;
    displaced(group, false, &whole);
    tissue->group = index;
    tissue->box = mesh_bounds(&whole);
    enum result result = cut_mesh_create(&whole, &tissue->mesh, err);
    if (result == RESULT_OK)
        result = tear(tissue->mesh, &group->lesion.tear, err);
    if (result == RESULT_OK) {
        tissue->plan = plan_of(scene->knee, group, &whole);
        if (group->maxcut)
            tissue->match = match_surface_create(&group->mesh, group->warp, group->maxcut);
    }
    mesh_fini(&whole);
    return result;
}

// ---- the scene ----------------------------------------------------------------------------------

static enum result add_group(struct scene *scene, int index, struct error *err) {
    const struct case_group *group = &scene->knee->groups[index];
    enum result result = query_create(&group->mesh, &scene->queries[index], err);
    if (group->warp || group->maxcut)
        scene->trees[index] = surface_tree_create(&group->mesh);
    if (group->warp)
        scene->means[index] = surface_mean_create(scene->trees[index], group->warp);
    scene->surfaces[index] = (struct warp_surface){
        .mesh = &group->mesh,
        .query = scene->queries[index],
        .displacement = group->warp,
        .body = group->body,
        .mean = scene->means[index],
    };
    if (result == RESULT_OK && group->cuttable)
        result = add_tissue(scene, index, err);
    return result;
}

enum result scene_create(struct knee_case **knee, struct scene **out_scene, struct error *err) {
    struct scene *scene = alloc(1, sizeof *scene);
    scene->knee = *knee;
    for (int i = 0; i < (*knee)->group_count; i++) {
        enum result result = add_group(scene, i, err);
        if (result != RESULT_OK) {
            scene->knee = NULL; // still the caller's
            scene_destroy(&scene);
            return fail_in(err, result, "case %s, group %s: ", (*knee)->name,
                           (*knee)->groups[i].name);
        }
    }
    *knee = NULL;
    *out_scene = scene;
    return RESULT_OK;
}

void scene_destroy(struct scene **scene) {
    struct scene *s = *scene;
    if (!s)
        return;
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        query_destroy(&s->queries[i]);
        surface_mean_destroy(&s->means[i]);
        surface_tree_destroy(&s->trees[i]);
    }
    for (int i = 0; i < s->tissue_count; i++) {
        cut_mesh_destroy(&s->tissues[i].mesh);
        match_surface_destroy(&s->tissues[i].match);
        quality_plan_destroy(&s->tissues[i].plan);
    }
    case_destroy(&s->knee);
    free(s);
    *scene = NULL;
}

const struct knee_case *scene_case(const struct scene *scene) {
    return scene->knee;
}

int scene_tissue_count(const struct scene *scene) {
    return scene->tissue_count;
}

int scene_tissue_group(const struct scene *scene, int tissue) {
    CHECK(tissue >= 0 && tissue < scene->tissue_count);
    return scene->tissues[tissue].group;
}
