#include "base/check.h"
#include "cut.h"
#include "fine_knee.h"
#include "step/operation.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const int sequences[3] = {20, 2, 0}, quick_sequences[3] = {3, 0, 0};

// What a trainee sees of the group: S' without its tear.
static enum result torn_mesh(const struct case_group *group, struct mesh *out, struct error *err) {
    struct mesh whole;
    struct cut_mesh *cut = NULL;
    case_group_virtual(group, &whole);
    enum result result = cut_mesh_create(&whole, &cut, err);
    const struct case_region *tear = &group->lesion.tear;
    for (int i = 0; result == RESULT_OK && i < tear->part_count; i += CUT_PARTS_MAX) {
        int count = tear->part_count - i;
        struct cut_change change = {0};
        if (cut_apply(cut, tear->parts + i, count < CUT_PARTS_MAX ? count : CUT_PARTS_MAX, &change,
                      err) == CUT_REFUSED)
            result = RESULT_REFUSED;
        cut_change_fini(&change);
    }
    if (result == RESULT_OK)
        cut_mesh_flatten(cut, out, NULL, NULL);
    cut_mesh_destroy(&cut);
    mesh_fini(&whole);
    return result;
}

static enum result cut_torn(const char *name, const struct case_group *group, bool quick,
                            struct report *report, struct cut_totals *totals, struct error *err) {
    struct mesh mesh;
    struct cut_plan plan = {name, &mesh, .is_timed = true};
    memcpy(plan.sequences, quick ? quick_sequences : sequences, sizeof plan.sequences);
    enum result result = torn_mesh(group, &mesh, err);
    if (result != RESULT_OK)
        return result;
    cut_sequences(&plan, report, totals);
    cut_by_knife(name, &mesh, quick ? 40 : 300, report, totals);
    mesh_fini(&mesh);
    return RESULT_OK;
}

static enum result resect(const char *name, struct knee_case **knee,
                          const struct touch_moves *moves, struct report *report,
                          struct cut_totals *totals, struct error *err) {
    struct scene *scene;
    enum result result = scene_create(knee, &scene, err);
    if (result != RESULT_OK)
        return result;
    cut_jobs(&(struct cut_resection){name, scene, moves}, report, totals);
    scene_destroy(&scene);
    return RESULT_OK;
}

enum result cut_lesion(const char *dir, const char *recipe, bool quick, struct report *report,
                       struct cut_totals *totals, struct error *err) {
    char name[2 * CASE_NAME_MAX];
    struct knee_case *knee;
    struct touch_moves moves;
    enum result result = touch_resection(dir, recipe, &knee, &moves, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s: ", recipe);
    snprintf(name, sizeof name, "%s/%s", dir ? knee->name : "20k", recipe);
    if (!dir) {
        case_destroy(&knee);
        result = fine_knee(recipe, &knee, err);
    }
    const struct case_group *group = result == RESULT_OK ? case_group(knee, moves.group) : NULL;
    if (result == RESULT_OK && !group)
        result = fail(err, RESULT_MISSING, "%s: nothing was cut", name);
    if (result == RESULT_OK)
        result = cut_torn(name, group, quick, report, totals, err);
    if (result == RESULT_OK)
        result = resect(name, &knee, &moves, report, totals, err);
    free(moves.moves);
    case_destroy(&knee);
    return result;
}
