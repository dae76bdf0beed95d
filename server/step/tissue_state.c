#include "step/tissue_state.h"

#include "base/check.h"
#include "step/apart.h"
#include "step/settings.h"

#include <stdlib.h>

#define FREED_MM3 0.5 // smaller pieces are crumbs
#define PROBES_MAX 32 // points of a cut's surface whose distance to S'' is measured

struct tissue_figures tissue_figures_whole(const struct scene_tissue *tissue) {
    struct tissue_figures figures = {
        .volume_mm3 = cut_mesh_volume(tissue->mesh),
        .warped_mm3 = tissue->match ? match_surface_volume(tissue->match) : 0,
    };
    struct quality *quality = quality_create(tissue->plan);
    quality_report(quality, &figures.quality);
    quality_destroy(&quality);
    return figures;
}

struct tissue_state tissue_state_whole(const struct scene_tissue *tissue, int rules,
                                       uint32_t mesh_number) {
    bool fitted = rules >= RULES_TOUCH_FITTED;
    struct tissue_state r = {
        .mesh = cut_mesh_copy(tissue->mesh),
        .match = tissue->match && !fitted ? match_create(tissue->match) : NULL,
        .solid = tissue->match && fitted && tissue->solid ? cut_mesh_copy(tissue->solid) : NULL,
        .quality = quality_create(tissue->plan),
    };
    r.figures = tissue->whole;
    r.figures.mesh_number = mesh_number;
    return r;
}

struct tissue_state tissue_state_copy(const struct tissue_state *r) {
    struct tissue_state copy = *r;
    copy.mesh = cut_mesh_copy(r->mesh);
    copy.match = r->match ? match_copy(r->match) : NULL;
    copy.solid = r->solid ? cut_mesh_copy(r->solid) : NULL;
    copy.quality = quality_copy(r->quality);
    return copy;
}

void tissue_state_release(struct tissue_state *r) {
    cut_mesh_destroy(&r->mesh);
    match_destroy(&r->match);
    cut_mesh_destroy(&r->solid);
    quality_destroy(&r->quality);
}

static void keep_mesh(struct cut_mesh **mesh, const struct cut_mesh *whole, struct kept *k) {
    if (k->reads)
        cut_mesh_destroy(mesh);
    cut_mesh_keep(mesh, whole, k);
}

void tissue_state_keep(struct tissue_state *r, const struct scene_tissue *tissue, struct kept *k) {
    bool has_solid = r->solid;
    CHECK(!r->match);
    keep_mesh(&r->mesh, tissue->mesh, k);
    kept_count(k, &r->number, UINT32_MAX - 1);
    kept_flag(k, &has_solid);
    kept_holds(k, !has_solid || r->solid);
    if (has_solid && r->solid)
        keep_mesh(&r->solid, tissue->solid, k);
    else
        cut_mesh_destroy(&r->solid);
    kept_count(k, &r->solid_number, UINT32_MAX - 1);
    quality_keep(r->quality, k);
    kept_bytes(k, &r->figures, sizeof r->figures);
}

const struct cut_mesh *tissue_state_target(const struct tissue_state *r, uint32_t *out_number) {
    *out_number = r->solid ? r->solid_number : r->number;
    return r->solid ? r->solid : r->mesh;
}

// ---- a cut --------------------------------------------------------------------------------------

// What the tissue's own volume lost, S'' is to lose too.
static void match_cut(struct tissue_state *r, const struct scene_tissue *tissue,
                      const struct cut_change *change, struct touch_change *out_touch) {
    struct brush *brushes = alloc((size_t)change->patch_count + 1, sizeof *brushes);
    for (int i = 0; i < change->patch_count; i++)
        brushes[i] = (struct brush){change->patches[i].centroid, change->patches[i].extent};
    struct match_report report;
    match_to_volume(r->match, brushes, change->patch_count,
                    match_surface_volume(tissue->match) - r->figures.left_mm3, &report);
    free(brushes);
    r->figures.warped_mm3 = report.volume_mm3;
    r->figures.left_mm3 = report.left_mm3;
    touch_change_make_room(out_touch, 1, report.changed_count);
    for (uint32_t i = 0; i < report.changed_count; i++) {
        out_touch->vertices[i] = report.changed[i];
        out_touch->values[i] = match_blends(r->match)[report.changed[i]];
    }
    out_touch->count = report.changed_count;
}

static double pieces_mm3(const struct cut_change *change) {
    double sum = 0;
    for (int i = 0; i < change->piece_count; i++)
        sum += change->pieces[i].volume;
    return sum;
}

static void count_cut(struct tissue_state *r, const struct cut_change *change) {
    struct tissue_figures *f = &r->figures;
    f->mesh_number++;
    f->cuts++;
    f->volume_mm3 = change->volume_mm3;
    f->removed_mm3 += change->removed_mm3;
    f->pieces_mm3 += pieces_mm3(change);
    f->pieces += (uint32_t)change->piece_count;
    f->left_mm3 = f->removed_mm3 + f->pieces_mm3;
    r->number = change->number;
}

// If a tear lets tissue come off that the solid tissue keeps, or if the solid tissue cannot be cut,
// then the touch follows the tissue as it is, tears and all.
static void cut_solid(struct tissue_state *r, const struct convex *parts, int count,
                      const struct cut_change *of_mesh) {
    struct cut_change change = {0};
    struct error why;
    enum cut_outcome outcome = cut_apply(r->solid, parts, count, &change, &why);
    if (outcome == CUT_CHANGED)
        r->solid_number = change.number;
    if (outcome == CUT_REFUSED || pieces_mm3(of_mesh) > pieces_mm3(&change) + FREED_MM3)
        cut_mesh_destroy(&r->solid);
    cut_change_fini(&change);
}

void tissue_state_cut(struct tissue_state *r, const struct scene_tissue *tissue,
                      const struct instruments *instruments, const struct blade_move *move,
                      int rules, struct job_result *result) {
    static const enum job_outcome outcomes[] = {
        [CUT_CHANGED] = JOB_DONE, [CUT_NOTHING] = JOB_NOTHING, [CUT_REFUSED] = JOB_REFUSED};
    struct convex *parts = alloc(CUT_PARTS_MAX, sizeof *parts);
    struct cut_change *change = &result->change;
    int count = blade_parts(instruments, move, rules >= RULES_SWEPT_TIGHTLY, parts, &result->why);
    result->outcome = count < 0 ? JOB_REFUSED : JOB_NOTHING;
    if (count > 0)
        result->outcome = outcomes[cut_apply(r->mesh, parts, count, change, &result->why)];
    if (result->outcome == JOB_DONE) {
        count_cut(r, change);
        if (r->match)
            match_cut(r, tissue, change, &result->touch);
        if (r->solid)
            cut_solid(r, parts, count, change);
        quality_take_parts(r->quality, parts, count);
        for (int i = 0; i < change->piece_count; i++)
            quality_take_piece(r->quality, &change->pieces[i].mesh);
    }
    free(parts);
}

double tissue_state_apart_mm(const struct tissue_state *r, const struct mesh *mesh,
                             const struct cut_change *change) {
    struct mesh touched;
    vec3 probes[PROBES_MAX + 1];
    uint32_t count = 0, stride = 1 + change->vertex_count / PROBES_MAX;
    if (!r->match || !change->patch_count)
        return 0;
    mesh_copy(&touched, mesh);
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        mesh_set_vertex(&touched, i, match_vertex(r->match, i));
    for (uint32_t i = 0; i < change->vertex_count; i += stride)
        probes[count++] = cut_mesh_vertex(r->mesh, change->vertices[i]);
    double largest = apart_mm(&touched, probes, count);
    mesh_fini(&touched);
    return largest;
}
