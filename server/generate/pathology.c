#include "generate/pathology.h"

#include "generate/keys.h"
#include "generate/maxcut.h"

#include <string.h>

static pose joint_of(const struct knee_case *knee, enum body body) {
    return body == BODY_TIBIA ? knee->joint.T_tibia_joint : knee->joint.T_femur_joint;
}

// ---- bones --------------------------------------------------------------------------------------

static bool has_lesion(const struct case_group *group) {
    const struct case_lesion *lesion = &group->lesion;
    return lesion->tear.part_count || lesion->damage.part_count || lesion->plan.part_count;
}

// Whether the dent may move it: its middle lies within half of the radius of `at`.
static bool may_move(const struct case_group *group, const struct deform_cavity *dent) {
    struct mesh mesh;
    bool moves = false;
    case_group_virtual(group, &mesh);
    for (uint32_t v = 0; v < mesh.vertex_count && !moves; v++)
        moves = vec3_distance(mesh_vertex(&mesh, v), dent->at) <=
                1.5 * dent->radius_mm + dent->depth_mm;
    mesh_fini(&mesh);
    return moves;
}

// All groups of the body, its bone first; 0 where there is none.
static int groups_of(struct knee_case *knee, enum body body, struct case_group **out_groups) {
    int count = 0;
    out_groups[count++] = case_group(knee, body_name(body));
    for (int i = 0; i < knee->group_count; i++)
        if (knee->groups[i].body == body && &knee->groups[i] != out_groups[0])
            out_groups[count++] = &knee->groups[i];
    return out_groups[0] ? count : 0;
}

// In the frame of the body.
static enum result place_of_step(const struct knee_case *knee, const struct pathology_place *place,
                                 vec3 *out_at, struct error *err) {
    const char *name = place->landmark;
    const struct case_landmark *landmark = case_landmark(knee, name);
    vec3 at = place->at;
    if (knee->joint.side == SIDE_LEFT)
        at.x = -at.x;
    *out_at = pose_apply(joint_of(knee, place->body), at);
    if (!name[0])
        return RESULT_OK;
    if (!landmark)
        return fail(err, RESULT_MISSING, "the case has no landmark %s", name);
    if (landmark->body != place->body)
        return fail(err, RESULT_INVALID, "%s is a landmark of the %s, not of the %s", name,
                    body_name(landmark->body), body_name(place->body));
    *out_at = landmark->at;
    return RESULT_OK;
}

static enum result add_cavity(struct knee_case *knee, const struct pathology_cavity *cavity,
                              double rim_mm, struct error *err) {
    struct case_group *groups[CASE_GROUPS_MAX + 1];
    enum body body = cavity->place.body;
    struct deform_cavity dent = {.radius_mm = cavity->radius_mm, .depth_mm = cavity->depth_mm};
    enum result result = place_of_step(knee, &cavity->place, &dent.at, err);
    if (result != RESULT_OK)
        return result;
    int count = groups_of(knee, body, groups);
    if (!count)
        return fail(err, RESULT_MISSING, "the case has no group %s", body_name(body));
    for (int i = 0; i < count; i++)
        if (has_lesion(groups[i]) && may_move(groups[i], &dent))
            return fail(err, RESULT_INVALID,
                        "%s has a tear or a plan, which would not follow: make the cavity before",
                        groups[i]->name);
    dent.refines = knee->has_scan; // a recipe's triangles are small and even
    result = deform_cavity_add(groups, count, &dent, err);
    for (int i = 0; i < count && result == RESULT_OK; i++)
        if (groups[i]->maxcut && may_move(groups[i], &dent))
            result = maxcut_make(groups[i], joint_of(knee, body), rim_mm, err);
    return result;
}

static enum result add_wear(struct knee_case *knee, const struct pathology_wear *wear,
                            struct error *err) {
    struct case_group *groups[CASE_GROUPS_MAX + 1];
    struct wear_patch patch = {.radius_mm = wear->radius_mm, .grade = wear->grade};
    enum result result = place_of_step(knee, &wear->place, &patch.at, err);
    if (result != RESULT_OK)
        return result;
    int count = groups_of(knee, wear->place.body, groups);
    if (!count)
        return fail(err, RESULT_MISSING, "the case has no group %s", body_name(wear->place.body));
    return wear_add(groups, count, &patch, err);
}

// ---- menisci ------------------------------------------------------------------------------------

static enum result make_cuttable(struct knee_case *knee, struct case_group *group, double rim_mm,
                                 struct error *err) {
    bool was_cuttable = group->cuttable;
    group->cuttable = true;
    enum result result = was_cuttable ? RESULT_OK : case_validate(knee, err);
    if (result == RESULT_OK && !group->maxcut && rim_mm > 0)
        result = maxcut_make(group, joint_of(knee, group->body), rim_mm, err);
    return result;
}

static enum result damage(struct case_group *group, const struct arc *arc,
                          const struct pathology *step, double rim_mm, struct error *err) {
    if (step->kind == PATHOLOGY_PLAN)
        return plan_set(group, arc, &step->plan.resection, rim_mm, err);
    return tear_add(group, arc, &step->tear.tear, rim_mm, err);
}

static enum result treat_meniscus(struct knee_case *knee, const struct pathology *step,
                                  double rim_mm, struct error *err) {
    bool torn = step->kind == PATHOLOGY_TEAR;
    const char *name = torn ? step->tear.group : step->plan.group;
    struct case_group *group = case_group(knee, name);
    struct mesh mesh;
    struct arc *arc = NULL;
    if (!group)
        return fail(err, RESULT_MISSING, "the case has no group %s", name);
    if (!group->tissue.has_zones)
        return fail(err, RESULT_INVALID, "%s is no meniscus, as it has no zones (case.json)", name);
    enum result result = make_cuttable(knee, group, rim_mm, err);
    if (result != RESULT_OK)
        return result;
    case_group_virtual(group, &mesh);
    result = arc_create(&mesh, joint_of(knee, group->body), &arc, err);
    if (result == RESULT_OK)
        result = damage(group, arc, step, rim_mm, err);
    arc_destroy(&arc);
    mesh_fini(&mesh);
    return result;
}

// ---- any ----------------------------------------------------------------------------------------

enum result pathology_apply(struct knee_case *knee, const struct pathology *step, double rim_mm,
                            struct error *err) {
    if (step->kind == PATHOLOGY_LIGAMENT)
        return keys_add(knee, step->name, &step->ligament, err);
    if (step->kind == PATHOLOGY_CAVITY)
        return add_cavity(knee, &step->cavity, rim_mm, err);
    if (step->kind == PATHOLOGY_WEAR)
        return add_wear(knee, &step->wear, err);
    if (step->kind == PATHOLOGY_TISSUE)
        return add_tissue_apply(knee, step->name, &step->tissue, err);
    if (step->kind == PATHOLOGY_LOOSE)
        return add_loose_apply(knee, step->name, &step->loose, err);
    return treat_meniscus(knee, step, rim_mm, err);
}
