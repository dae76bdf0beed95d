#include "step/scene.h"

#include "base/check.h"
#include "step/scene_parts.h"
#include "step/tissue_state.h"

#include <stdlib.h>
#include <string.h>

// ---- tissue -------------------------------------------------------------------------------------

// What follows each cut lays grids over the tissue, so their memory must have a bound.
#define TISSUE_MAX_MM 500

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

static enum result fits_grids(struct box box, struct error *err) {
    vec3 sides = vec3_sub(box.max, box.min);
    double longest = fmax(sides.x, fmax(sides.y, sides.z));
    if (longest <= TISSUE_MAX_MM)
        return RESULT_OK;
    return fail(err, RESULT_LIMIT, "it is %.0f mm long; tissue that can be cut has %d mm at most",
                longest, TISSUE_MAX_MM);
}

static void make_start(struct scene *scene, struct scene_tissue *tissue) {
    const struct case_group *group = &scene->knee->groups[tissue->group];
    if (!group->warp) {
        tissue->made.zeros = alloc(3 * (size_t)group->mesh.vertex_count, sizeof(float));
        tissue->made.mean = surface_mean_create(scene->trees[tissue->group], tissue->made.zeros);
        tissue->made.integral =
            surface_integral_create(scene->blocks[tissue->group], tissue->made.zeros);
    }
    tissue->start = group->warp ? group->warp : tissue->made.zeros;
    tissue->start_mean = group->warp ? scene->means[tissue->group] : tissue->made.mean;
    tissue->start_integral = group->warp ? scene->integrals[tissue->group] : tissue->made.integral;
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
    enum result result = fits_grids(tissue->box, err);
    if (result == RESULT_OK)
        result = cut_mesh_create(&whole, &tissue->mesh, err);
    if (result == RESULT_OK && group->lesion.tear.part_count)
        tissue->solid = cut_mesh_copy(tissue->mesh);
    if (result == RESULT_OK)
        result = tear(tissue->mesh, &group->lesion.tear, err);
    if (result == RESULT_OK) {
        tissue->plan = plan_of(scene->knee, group, &whole);
        if (group->maxcut)
            tissue->match = match_surface_create(&group->mesh, group->warp, group->maxcut);
        if (group->maxcut)
            make_start(scene, tissue);
        tissue->whole = tissue_figures_whole(tissue);
    }
    mesh_fini(&whole);
    return result;
}

// ---- ligaments ----------------------------------------------------------------------------------

enum result scene_adaptive(const struct knee_case *knee, enum adaptive_kind kind,
                           struct adaptive **out_adaptive, struct error *err) {
    struct adaptive_key keys[CASE_KEYS_MAX];
    for (int i = 0; i < knee->key_count; i++)
        keys[i] = (struct adaptive_key){knee->keys[i].ligament, knee->keys[i].physical,
                                        knee->keys[i].target};
    struct adaptive_setup setup = {kind,       knee->joint,     knee->rest_count,
                                   knee->rest, knee->key_count, keys};
    *out_adaptive = NULL;
    enum result result = adaptive_create(&setup, out_adaptive, err);
    if (result == RESULT_OK && kind == ADAPTIVE_HINGE)
        result = adaptive_check(*out_adaptive, err);
    if (result != RESULT_OK)
        adaptive_destroy(out_adaptive);
    return result;
}

void scene_correct(const struct scene *scene, enum adaptive_kind kind, enum adaptive_ramp ramp,
                   const pose T_frame_body[BODY_COUNT], struct adaptive_warp *out_adaptive,
                   pose out_correction[BODY_COUNT]) {
    for (int i = 0; i < BODY_COUNT; i++)
        out_correction[i] = pose_identity();
    memset(out_adaptive, 0, sizeof *out_adaptive);
    out_adaptive->correction = pose_identity();
    if (!scene->knee->key_count)
        return;
    pose T_frame_femur = T_frame_body[BODY_FEMUR], T_femur_frame = pose_inverse(T_frame_femur);
    pose T_femur_tibia = pose_compose(T_femur_frame, T_frame_body[BODY_TIBIA]);
    adaptive_at(scene->adaptive[kind], ramp, T_femur_tibia, out_adaptive);
    out_correction[BODY_TIBIA] =
        pose_compose(T_frame_femur, pose_compose(out_adaptive->correction, T_femur_frame));
}

void scene_stand(const struct scene *scene, enum adaptive_kind kind,
                 const struct joint_angles *joint, struct scene_stance *out) {
    out->T_femur_body[BODY_FEMUR] = pose_identity();
    out->T_femur_body[BODY_TIBIA] = joint_to_pose(&scene->knee->joint, joint);
    out->T_femur_body[BODY_PATELLA] = case_patella_pose(scene->knee, joint->flexion_deg);
    scene_correct(scene, kind, ADAPTIVE_RAMP_STRAIGHT, out->T_femur_body, &out->adaptive,
                  out->correction);
    out->warp = (struct warp_scene){scene->surfaces, scene->knee->group_count, out->T_femur_body,
                                    out->correction};
}

// ---- the scene ----------------------------------------------------------------------------------

static enum result add_group(struct scene *scene, int index, struct error *err) {
    const struct case_group *group = &scene->knee->groups[index];
    struct mesh *outer = &scene->outer[index];
    case_group_surface(group, outer);
    enum result result = query_create(outer, &scene->queries[index], err);
    if (result != RESULT_OK)
        return result;
    scene->blocks[index] = surface_blocks_create(outer);
    scene->integrals[index] = surface_integral_create(scene->blocks[index], group->warp);
    if (group->warp || group->maxcut)
        scene->trees[index] = surface_tree_create(outer);
    if (group->warp)
        scene->means[index] = surface_mean_create(scene->trees[index], group->warp);
    scene->surfaces[index] = (struct warp_surface){
        .mesh = outer,
        .query = scene->queries[index],
        .displacement = group->warp,
        .body = group->body,
        .other_body = group->other_body,
        .other_share = group->other_share,
        .mean = group->other_share ? NULL : scene->means[index],
        .integral = scene->integrals[index],
        .gives_way = case_group_is_skin(group),
    };
    return group->cuttable ? add_tissue(scene, index, err) : RESULT_OK;
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
    for (int kind = 0; kind < ADAPTIVE_COUNT; kind++) {
        enum result result =
            scene_adaptive(*knee, (enum adaptive_kind)kind, &scene->adaptive[kind], err);
        if (result != RESULT_OK) {
            scene->knee = NULL;
            scene_destroy(&scene);
            return fail_in(err, result, "case %s, torn ligaments: ", (*knee)->name);
        }
    }
    enum result result = loose_ground_create(*knee, &scene->loose_ground, err);
    if (result != RESULT_OK) {
        scene->knee = NULL;
        scene_destroy(&scene);
        return fail_in(err, result, "case %s: ", (*knee)->name);
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
        mesh_fini(&s->outer[i]);
        surface_integral_destroy(&s->integrals[i]);
        surface_blocks_destroy(&s->blocks[i]);
        surface_mean_destroy(&s->means[i]);
        surface_tree_destroy(&s->trees[i]);
    }
    for (int kind = 0; kind < ADAPTIVE_COUNT; kind++)
        adaptive_destroy(&s->adaptive[kind]);
    for (int i = 0; i < s->tissue_count; i++) {
        cut_mesh_destroy(&s->tissues[i].mesh);
        cut_mesh_destroy(&s->tissues[i].solid);
        match_surface_destroy(&s->tissues[i].match);
        quality_plan_destroy(&s->tissues[i].plan);
        surface_mean_destroy(&s->tissues[i].made.mean);
        surface_integral_destroy(&s->tissues[i].made.integral);
        free(s->tissues[i].made.zeros);
    }
    loose_ground_destroy(&s->loose_ground);
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

const struct cut_mesh *scene_tissue_mesh(const struct scene *scene, int tissue) {
    CHECK(tissue >= 0 && tissue < scene->tissue_count);
    return scene->tissues[tissue].mesh;
}
