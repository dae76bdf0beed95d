#include "case_pathology_report.h"

#include "case_keys.h"
#include "check/inspect.h"
#include "cut/cut.h"
#include "generate/maxcut.h"
#include "step/scene.h"

#include <stdio.h>
#include <string.h>

// ---- menisci ------------------------------------------------------------------------------------

// mm³ that clefts take, cut as a session does.
static enum result cut_clefts(const struct case_group *group, double *out_mm3, struct error *err) {
    const struct case_region *tear = &group->lesion.tear;
    struct mesh whole;
    struct cut_mesh *mesh;
    case_group_virtual(group, &whole);
    enum result result = cut_mesh_create(&whole, &mesh, err);
    mesh_fini(&whole);
    *out_mm3 = 0;
    for (int i = 0; i < tear->part_count && result == RESULT_OK; i += CUT_PARTS_MAX) {
        int count = tear->part_count - i < CUT_PARTS_MAX ? tear->part_count - i : CUT_PARTS_MAX;
        struct cut_change change = {0};
        if (cut_apply(mesh, tear->parts + i, count, &change, err) == CUT_REFUSED)
            result = fail_in(err, RESULT_INVALID, "the tear cannot be cut: ");
        else if (change.piece_count)
            result = fail(err, RESULT_INVALID, "the tear cuts a piece of %.1f mm3 off",
                          change.pieces[0].volume);
        *out_mm3 += change.removed_mm3;
        cut_change_fini(&change);
    }
    cut_mesh_destroy(&mesh);
    return result;
}

static enum result report_meniscus(const struct case_group *group, struct error *err) {
    struct maxcut_report report;
    double clefts_mm3;
    enum result result = cut_clefts(group, &clefts_mm3, err);
    if (result == RESULT_OK)
        result = maxcut_inspect(group, &report, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s: ", group->name);
    if (group->lesion.tear.part_count)
        printf("%s: the clefts take %.1f of %.0f mm3\n", group->name, clefts_mm3, report.whole_mm3);
    printf("%s: the plan takes %.0f mm3, %.1f of them beyond the greatest resection\n", group->name,
           report.plan_mm3, report.plan_beyond_mm3);
    return RESULT_OK;
}

// ---- bones --------------------------------------------------------------------------------------

static enum result report_cavity(const struct knee_case *knee, enum body body) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        double most = 0;
        for (size_t v = 0; group->warp && v < group->mesh.vertex_count; v++) {
            const float *w = group->warp + 3 * v;
            most = fmax(most, vec3_length((vec3){(double)w[0], (double)w[1], (double)w[2]}));
        }
        if (group->body == body && most > 0)
            printf("%s: displaced by up to %.2f mm\n", group->name, most);
    }
    return RESULT_OK;
}

static enum result report_wear(const struct knee_case *knee, enum body body) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        if (group->body == body && group->wear)
            printf("%s: grade %.1f at worst\n", group->name, inspect_worst_wear(group));
    }
    return RESULT_OK;
}

static enum result report_ligament(const struct knee_case *knee, const char *name,
                                   struct error *err) {
    struct adaptive *adaptive;
    enum result result = scene_adaptive(knee, ADAPTIVE_HINGE, &adaptive, err);
    adaptive_destroy(&adaptive);
    for (int i = 0; i < knee->key_count && result == RESULT_OK; i++)
        if (strcmp(knee->torn[knee->keys[i].ligament], name) == 0)
            print_key(knee, i);
    return result;
}

static enum result report_loose(const struct knee_case *knee) {
    for (int i = 0; i < knee->loose_count; i++) {
        const struct case_loose *loose = &knee->loose[i];
        printf("%s: on the %s at %.1f %.1f %.1f, half axes %g %g %g mm\n", loose->name,
               body_name(loose->body), loose->at.x, loose->at.y, loose->at.z, loose->radii_mm.x,
               loose->radii_mm.y, loose->radii_mm.z);
    }
    return RESULT_OK;
}

static enum result report_tissue(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        const struct case_tissue *tissue = &group->tissue;
        if (strcmp(group->name, name) == 0)
            printf("%s: %s, %s, side %s, colour #%06x%s%s\n", name, tissue->label,
                   tissue_kind_name(tissue->kind), tissue_side_name(tissue->side),
                   (unsigned)tissue->colour, group->cuttable ? ", cuttable" : "",
                   tissue->has_zones ? ", with zones" : "");
    }
    return RESULT_OK;
}

enum result pathology_report(const struct knee_case *knee, const struct pathology *step,
                             struct error *err) {
    const char *meniscus = step->kind == PATHOLOGY_TEAR ? step->tear.group : step->plan.group;
    if (step->kind == PATHOLOGY_LIGAMENT)
        return report_ligament(knee, step->name, err);
    if (step->kind == PATHOLOGY_TISSUE)
        return report_tissue(knee, step->name);
    if (step->kind == PATHOLOGY_LOOSE)
        return report_loose(knee);
    if (step->kind == PATHOLOGY_CAVITY)
        return report_cavity(knee, step->cavity.place.body);
    if (step->kind == PATHOLOGY_WEAR)
        return report_wear(knee, step->wear.place.body);
    for (int i = 0; i < knee->group_count; i++)
        if (strcmp(knee->groups[i].name, meniscus) == 0)
            return report_meniscus(&knee->groups[i], err);
    return RESULT_OK;
}
