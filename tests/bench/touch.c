#include "touch.h"

#include "apart.h"
#include "base/check.h"
#include "cutting/crossings.h"
#include "fine_knee.h"
#include "kernel_time.h"
#include "match/conform.h"
#include "match/mismatch.h"
#include "meniscectomy.h"
#include "paper.h"
#include "samples.h"
#include "touch_moves.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COLUMN_MM 0.08

// ---- a scene: cuts, and S'' after each ----------------------------------------------------------

struct scene_of_cuts {
    const char *name;
    const struct case_group *group;
    const struct blade_move *moves;
    int move_count;
    enum scene_kind kind;
    bool is_timed; // its times count
};

struct touched {
    struct mesh whole; // S'
    struct match_surface *surface;
    struct conform *conform;
    struct cut_mesh *cut; // T: S' minus the blades, without the clefts of tears
    struct samples ms, changed;
    int cuts, repairs, reverted;
    uint32_t crossings_first;
    double error, left_mm3, sheet_mm3;
};

static enum result touched_init(struct touched *t, const struct case_group *group,
                                struct error *err) {
    *t = (struct touched){0};
    case_group_virtual(group, &t->whole);
    t->surface = match_surface_create(&group->mesh, group->warp, group->maxcut);
    t->conform = conform_create(t->surface);
    return cut_mesh_create(&t->whole, &t->cut, err);
}

static void touched_fini(struct touched *t) {
    conform_destroy(&t->conform);
    match_surface_destroy(&t->surface);
    cut_mesh_destroy(&t->cut);
    mesh_fini(&t->whole);
    samples_fini(&t->ms);
    samples_fini(&t->changed);
}

static bool is_made(const struct cut_change *change, uint32_t id) {
    uint32_t low = 0, high = change->made_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (change->made[middle] < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low < change->made_count && change->made[low] == id;
}

// Those that the change made, of the blade's own surface; without a change, of all blades.
static bool *fresh_of(const struct cut_mesh *cut, const struct cut_change *change,
                      const uint32_t *ids, uint32_t count) {
    bool *fresh = alloc(count, sizeof *fresh);
    for (uint32_t i = 0; i < count; i++)
        fresh[i] = cut_mesh_label(cut, ids[i]) && (!change || is_made(change, ids[i]));
    return fresh;
}

static void follow(struct touched *t, const struct cut_change *change) {
    struct mesh mesh;
    uint32_t *ids;
    cut_mesh_flatten(t->cut, &mesh, NULL, &ids);
    bool *fresh = fresh_of(t->cut, change, ids, mesh.triangle_count);
    struct conform_target target = {&mesh, fresh, change->volume_mm3, true, true};
    struct conform_report report;
    double begin = thread_ms();
    conform_to(t->conform, &target, &report);
    samples_add(&t->ms, thread_ms() - begin);
    samples_add(&t->changed, report.changed_count);
    t->cuts++;
    t->repairs += report.repairs;
    t->reverted += report.reverted_count > 0;
    t->crossings_first += report.crossings_first;
    double left = conform_volume(t->conform) - change->volume_mm3 - report.sheet_mm3;
    t->left_mm3 = fmax(t->left_mm3, fabs(left));
    t->sheet_mm3 = report.sheet_mm3;
    t->error = fmax(t->error, fabs(left) / match_surface_volume(t->surface));
    free(fresh);
    free(ids);
    mesh_fini(&mesh);
}

static enum result take(struct touched *t, const struct convex *parts, int count,
                        struct error *err) {
    struct cut_change change = {0};
    enum cut_outcome outcome = cut_apply(t->cut, parts, count, &change, err);
    if (outcome == CUT_CHANGED)
        follow(t, &change);
    cut_change_fini(&change);
    return outcome == CUT_REFUSED ? RESULT_REFUSED : RESULT_OK;
}

static enum result cut_by(struct touched *t, const struct blade_move *move, struct error *err) {
    struct convex *parts = alloc(CUT_PARTS_MAX, sizeof *parts);
    int count = blade_parts(instruments_usual(), move, true, parts, err);
    enum result result = count < 0 ? RESULT_REFUSED : RESULT_OK;
    if (count > 0)
        result = take(t, parts, count, err);
    free(parts);
    return result;
}

// ---- what is left of it -------------------------------------------------------------------------

static int crossings_of(const struct touched *t) {
    struct snapshot snapshot;
    snapshot_of_mesh(&t->whole, &snapshot);
    int before = snapshot_crossings(&snapshot);
    for (uint32_t v = 0; v < t->whole.vertex_count; v++)
        snapshot.vertices[v] = conform_vertex(t->conform, v);
    int after = snapshot_crossings(&snapshot);
    snapshot_fini(&snapshot);
    return after > before ? after - before : 0;
}

static void touched_mesh(const struct touched *t, struct mesh *out_mesh, bool *out_moved) {
    mesh_copy(out_mesh, &t->whole);
    for (uint32_t v = 0; v < out_mesh->vertex_count; v++)
        mesh_set_vertex(out_mesh, v, conform_vertex(t->conform, v));
    for (uint32_t i = 0; i < out_mesh->triangle_count; i++) {
        out_moved[i] = false;
        for (int k = 0; k < 3; k++) {
            uint32_t v = out_mesh->triangles[3 * (size_t)i + (size_t)k];
            out_moved[i] |= vec3_distance(mesh_vertex(&t->whole, v), mesh_vertex(out_mesh, v)) > 0;
        }
    }
}

static enum result distances(const struct mesh *touched, const bool *moved, const struct mesh *cut,
                             const bool *fresh, struct samples out[2], struct error *err) {
    enum result result = apart_distances(cut, fresh, touched, &out[0], err);
    if (result == RESULT_OK)
        result = apart_distances(touched, moved, cut, &out[1], err);
    return result;
}

static struct mismatch mismatch_of(const struct mesh *touched, const struct mesh *cut,
                                   const struct case_region *tear) {
    struct mismatch m;
    struct mismatch_setting setting = {.touched = touched,
                                       .tissue = cut,
                                       .clefts = tear->parts,
                                       .cleft_count = tear->part_count,
                                       .step_mm = COLUMN_MM};
    mismatch_measure(&setting, &m);
    return m;
}

static void report_scene(struct report *report, const struct scene_of_cuts *scene,
                         struct touched *t, const struct mismatch *m, double share,
                         struct samples apart[2]) {
    const char *name = scene->name;
    report_figure(report, t->cuts, "cuts", "touch/%s/cuts", name);
    report_figure(report, share, "of the cut", "touch/%s/mismatch", name);
    report_figure(report, m->touched_mm3, "mm3", "touch/%s/touched, not seen", name);
    report_figure(report, m->seen_mm3, "mm3", "touch/%s/seen, not touched", name);
    report_figure(report, samples_mean(&apart[0]), "mm", "touch/%s/T to S''/mean", name);
    report_figure(report, samples_quantile(&apart[0], 0.95), "mm", "touch/%s/T to S''/p95", name);
    report_figure(report, samples_mean(&apart[1]), "mm", "touch/%s/S'' to T/mean", name);
    report_figure(report, samples_quantile(&apart[1], 0.95), "mm", "touch/%s/S'' to T/p95", name);
    report_figure(report, t->crossings_first, "pairs", "touch/%s/crossings before repair", name);
    report_figure(report, t->repairs, "rounds", "touch/%s/repairs", name);
    report_figure(report, t->reverted, "cuts", "touch/%s/went back", name);
    report_figure(report, t->left_mm3, "mm3", "touch/%s/volume left, largest", name);
    if (scene->kind == SCENE_THROUGH)
        report_figure(report, t->sheet_mm3, "mm3", "touch/%s/laid down as a sheet", name);
    report_figure(report, samples_quantile(&t->changed, 0.5), "vertices", "touch/%s/moved/p50",
                  name);
    report_figure(report, samples_quantile(&t->ms, 0.5), "ms", "touch/%s/p50", name);
    report_figure(report, samples_quantile(&t->ms, 0.95), "ms", "touch/%s/p95", name);
}

static enum result look_back(const struct scene_of_cuts *scene, struct touched *t,
                             struct report *report, struct touch_worst *worst, struct error *err) {
    struct mesh cut, touched;
    uint32_t *ids;
    cut_mesh_flatten(t->cut, &cut, NULL, &ids);
    bool *fresh = fresh_of(t->cut, NULL, ids, cut.triangle_count);
    bool *moved = alloc(t->whole.triangle_count, sizeof *moved);
    struct samples apart[2] = {0};
    touched_mesh(t, &touched, moved);
    enum result result = distances(&touched, moved, &cut, fresh, apart, err);
    struct mismatch m = mismatch_of(&touched, &cut, &scene->group->lesion.tear);
    double cut_mm3 = mismatch_of(&t->whole, &cut, &scene->group->lesion.tear).touched_mm3;
    double share = (m.touched_mm3 + m.seen_mm3) / cut_mm3;
    worst->share[scene->kind] = fmax(worst->share[scene->kind], share);
    if (scene->kind != SCENE_THROUGH) {
        worst->surface_p95_mm = fmax(worst->surface_p95_mm, samples_quantile(&apart[0], 0.95));
        worst->error = fmax(worst->error, t->error);
    }
    worst->crossings += crossings_of(t);
    if (scene->is_timed)
        worst->p50_ms = fmax(worst->p50_ms, samples_quantile(&t->ms, 0.5));
    report_scene(report, scene, t, &m, share, apart);
    samples_fini(&apart[0]);
    samples_fini(&apart[1]);
    free(ids);
    free(fresh);
    free(moved);
    mesh_fini(&cut);
    mesh_fini(&touched);
    return result;
}

static enum result cut_all(const struct scene_of_cuts *scene, struct touched *t,
                           struct error *err) {
    enum result result = touched_init(t, scene->group, err);
    for (int i = 0; result == RESULT_OK && i < scene->move_count; i++)
        result = cut_by(t, &scene->moves[i], err);
    return result;
}

// ---- the scenes ---------------------------------------------------------------------------------

static const char *const resections[] = {"tear-flap", "tear-radial", "tear-horizontal"};
#define RESECTION_COUNT (int)(sizeof resections / sizeof resections[0])

// What all scenes of one call have in common.
struct touring {
    const struct bench_options *options;
    struct report *report;
    struct touch_worst *worst;
};

static enum result fifteen_bites(const struct touring *tour, const struct knee_case *knee,
                                 bool is_real, struct error *err) {
    struct meniscectomy m;
    struct touched t;
    char name[CASE_NAME_MAX + 16];
    enum result result = meniscectomy_init(&m, knee, err);
    if (result != RESULT_OK)
        return result;
    snprintf(name, sizeof name, "%s, through", knee->name);
    struct scene_of_cuts bites = {knee->name, m.group, m.bites, BITE_COUNT, SCENE_BITES, is_real};
    struct scene_of_cuts through = {name, m.group, NULL, 0, SCENE_THROUGH, false};
    result = cut_all(&bites, &t, err);
    if (result == RESULT_OK)
        result = look_back(&bites, &t, tour->report, tour->worst, err);
    if (result == RESULT_OK)
        result = take(&t, &m.section, 1, err);
    if (result == RESULT_OK)
        result = look_back(&through, &t, tour->report, tour->worst, err);
    touched_fini(&t);
    meniscectomy_fini(&m);
    return result;
}

static enum result play(const struct touring *tour, const struct scene_of_cuts *scene,
                        struct error *err) {
    struct touched t;
    enum result result = cut_all(scene, &t, err);
    if (result == RESULT_OK)
        result = look_back(scene, &t, tour->report, tour->worst, err);
    touched_fini(&t);
    return result;
}

struct resecting {
    const char *dir, *recipe; // dir: of a case; NULL: the generated knee
    bool is_fine;             // generated as fine_knee.h has it
};

static void name_scene(const struct resecting *r, const struct knee_case *knee, size_t size,
                       char *out) {
    const char *of = r->dir ? knee->name : r->is_fine ? "20k" : "";
    snprintf(out, size, "%s%s%s", of, *of ? ", " : "", r->recipe);
}

static enum result resection(const struct touring *tour, const struct resecting *r,
                             struct error *err) {
    struct knee_case *knee;
    struct touch_moves moves;
    char name[2 * CASE_NAME_MAX];
    enum result result = touch_resection(r->dir, r->recipe, &knee, &moves, err);
    if (result == RESULT_OK && r->is_fine) {
        case_destroy(&knee);
        result = fine_knee(r->recipe, &knee, err);
    }
    if (result != RESULT_OK)
        return fail_in(err, result, "%s: ", r->recipe);
    name_scene(r, knee, sizeof name, name);
    struct scene_of_cuts scene = {name,
                                  case_group(knee, moves.group),
                                  moves.moves,
                                  moves.count,
                                  SCENE_RESECTION,
                                  r->dir || r->is_fine};
    result = scene.group ? play(tour, &scene, err)
                         : fail(err, RESULT_MISSING, "%s: nothing was cut", r->recipe);
    free(moves.moves);
    case_destroy(&knee);
    return result;
}

static enum result measure_knee(const struct touring *tour, const char *dir, struct error *err) {
    struct knee_case *knee;
    enum result result = dir ? case_load(dir, NULL, &knee, err) : paper_knee("healthy", &knee, err);
    if (result != RESULT_OK)
        return result;
    result = fifteen_bites(tour, knee, dir != NULL, err);
    int count = tour->options->quick ? 1 : RESECTION_COUNT;
    for (int i = 0; result == RESULT_OK && i < count; i++)
        result = resection(tour, &(struct resecting){dir, resections[i], false}, err);
    if (result != RESULT_OK)
        result = fail_in(err, result, "%s: ", knee->name);
    case_destroy(&knee);
    return result;
}

enum result touch_measure(const struct bench_options *options, struct report *report,
                          struct touch_worst *out_worst, struct error *err) {
    struct touring tour = {options, report, out_worst};
    *out_worst = (struct touch_worst){0};
    enum result result = measure_knee(&tour, NULL, err);
    int fine = options->quick ? 1 : FINE_LESIONS;
    for (int i = 0; result == RESULT_OK && i < fine; i++)
        result = resection(&tour, &(struct resecting){NULL, fine_lesions[i], true}, err);
    for (int i = 0; result == RESULT_OK && i < options->input_count; i++)
        result = measure_knee(&tour, options->inputs[i], err);
    return result;
}
