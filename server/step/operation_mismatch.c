// Where the touch and the tissue still differ.
#include "base/check.h"
#include "match/mismatch.h"
#include "step/operation_parts.h"

#include <stdlib.h>
#include <string.h>

#define COLUMN_MM 0.25

vec3 operated_touched(const struct operated_tissue *t, uint32_t vertex) {
    if (!t->now.mesh)
        return match_surface_vertex(t->scene->match, vertex);
    return t->fitting ? fitting_vertex(t->fitting, vertex) : match_vertex(t->now.match, vertex);
}

static void touched_mesh(const struct operated_tissue *t, struct mesh *out_mesh) {
    if (!operated_touch_width(t)) {
        case_group_virtual(t->group, out_mesh);
        return;
    }
    mesh_copy(out_mesh, &t->group->mesh);
    for (uint32_t i = 0; i < out_mesh->vertex_count; i++)
        mesh_set_vertex(out_mesh, i, operated_touched(t, i));
}

void operated_measure_mismatch(struct operated_tissue *t) {
    struct mesh tissue;
    struct mismatch mismatch;
    uint32_t *ids;
    cut_mesh_flatten(t->now.mesh, &tissue, NULL, &ids);
    const struct case_region *tear = &t->group->lesion.tear;
    struct mismatch_setting setting = {.touched = fitting_touched(t->fitting),
                                       .tissue = &tissue,
                                       .clefts = tear->parts,
                                       .cleft_count = tear->part_count,
                                       .step_mm = COLUMN_MM,
                                       .triangle_ids = ids};
    mismatch_measure(&setting, &mismatch);
    t->now.figures.touched_unseen_mm3 = mismatch.touched_mm3;
    t->now.figures.seen_untouched_mm3 = mismatch.seen_mm3;
    free(ids);
    mesh_fini(&tissue);
}

// Clefts are touched as if they were closed, until the touch has to follow them.
void operation_mismatch(const struct operation *operation, int tissue, double *out_mm) {
    const struct operated_tissue *t = &operation->tissues[tissue];
    const struct case_region *tear = &t->group->lesion.tear;
    bool closed =
        operated_touch_width(t) != 3 || (t->now.mesh ? !!t->now.solid : !!t->scene->solid);
    struct mesh touched, seen;
    uint32_t *ids;
    touched_mesh(t, &touched);
    cut_mesh_flatten(operated_mesh(t), &seen, &ids, NULL);
    struct mismatch_setting setting = {.touched = &touched,
                                       .tissue = &seen,
                                       .clefts = tear->parts,
                                       .cleft_count = closed ? tear->part_count : 0};
    double *mm = alloc(seen.vertex_count, sizeof *mm);
    mismatch_at_vertices(&setting, ids, mm);
    memset(out_mm, 0, cut_mesh_vertex_bound(operated_mesh(t)) * sizeof *out_mm);
    for (uint32_t v = 0; v < seen.vertex_count; v++)
        out_mm[ids[v]] = mm[v];
    free(mm);
    free(ids);
    mesh_fini(&touched);
    mesh_fini(&seen);
}
