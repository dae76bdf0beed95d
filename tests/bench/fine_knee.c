#include "fine_knee.h"

#include "generate/generate.h"
#include "generate/maxcut.h"
#include "generate/tube.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define MENISCUS_MM2 5200.0 // over the square of its edges, its triangles

const char *const fine_lesions[FINE_LESIONS] = {"tear-flap", "tear-radial", "tear-horizontal",
                                                "tear-bucket-handle", "tear-arthrosis"};

static enum result make_fine(struct case_group *group, bool lateral, double cm3,
                             struct error *err) {
    mesh_fini(&group->mesh);
    free(group->warp);
    free(group->maxcut);
    group->warp = group->maxcut = NULL;
    if (!tube_meniscus(lateral, 1000 * cm3, sqrt(MENISCUS_MM2 / FINE_TRIANGLES), &group->mesh))
        return fail(err, RESULT_INVALID, "no fine meniscus of %g cm3", cm3);
    group->parts[0].vertex_count = group->mesh.vertex_count;
    group->parts[0].triangle_count = group->mesh.triangle_count;
    return RESULT_OK;
}

static enum result make_menisci(struct knee_case *knee, const struct recipe *recipe,
                                struct error *err) {
    enum result result =
        make_fine(case_group(knee, "meniscus_medial"), false, recipe->meniscus_medial_cm3, err);
    return result == RESULT_OK ? make_fine(case_group(knee, "meniscus_lateral"), true,
                                           recipe->meniscus_lateral_cm3, err)
                               : result;
}

static enum result make_maxcuts(struct knee_case *knee, double rim_mm, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < knee->group_count && result == RESULT_OK; i++)
        if (knee->groups[i].cuttable)
            result = maxcut_make(&knee->groups[i], knee->joint.T_tibia_joint, rim_mm, err);
    return result;
}

static enum result make_steps(struct knee_case *knee, const struct recipe *recipe,
                              enum pathology_kind kind, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < recipe->step_count && result == RESULT_OK; i++)
        if (recipe->steps[i].kind == kind)
            result = pathology_apply(knee, &recipe->steps[i], recipe->rim_mm, err);
    return result;
}

// The menisci alone are finer than the recipe has them: bones take long.
enum result fine_knee(const char *name, struct knee_case **out_knee, struct error *err) {
    char path[4096];
    struct recipe recipe, healthy;
    *out_knee = NULL;
    snprintf(path, sizeof path, "%s/%s", CASES, name);
    enum result result = recipe_load(path, &recipe, err);
    healthy = recipe;
    healthy.step_count = 0;
    if (result == RESULT_OK)
        result = generate_knee(&healthy, out_knee, err);
    if (result == RESULT_OK)
        result = make_menisci(*out_knee, &recipe, err);
    if (result == RESULT_OK)
        result = make_steps(*out_knee, &recipe, PATHOLOGY_CAVITY, err);
    if (result == RESULT_OK)
        result = make_maxcuts(*out_knee, recipe.rim_mm, err);
    if (result == RESULT_OK)
        result = make_steps(*out_knee, &recipe, PATHOLOGY_TEAR, err);
    if (result != RESULT_OK && *out_knee)
        case_destroy(out_knee);
    return result;
}
