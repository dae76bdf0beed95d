#include "touch.h"

#include "apart.h"
#include "base/check.h"
#include "cutting/crossings.h"
#include "match/conform.h"
#include "match/mismatch.h"
#include "meniscectomy.h"
#include "paper.h"
#include "touch_moves.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#define COLUMN_MM 0.08

// ---- a scene: cuts, and S'' after each ----------------------------------------------------------

struct scene_of_cuts {
    const char *name;
    const struct case_group *group;
    const struct blade_move *moves;
    int move_count;
    bool is_resection;
};

struct touched {
    struct mesh whole; // S'
    struct match_surface *surface;
    struct conform *conform;
    struct cut_mesh *cut; // T: S' minus the blades, without the clefts of tears
    struct samples ms, changed;
    int cuts, repairs, reverted;
    uint32_t crossings_first;
    double error, left_mm3;
};

static double thread_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

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
    struct conform_target target = {&mesh, fresh, change->volume_mm3};
    struct conform_report report;
    double begin = thread_ms();
    conform_to(t->conform, &target, &report);
    samples_add(&t->ms, thread_ms() - begin);
    samples_add(&t->changed, report.changed_count);
    t->cuts++;
    t->repairs += report.repairs;
    t->reverted += report.reverted_count > 0;
    t->crossings_first += report.crossings_first;
    double left = conform_volume(t->conform) - change->volume_mm3;
    t->left_mm3 = fmax(t->left_mm3, fabs(report.left_mm3));
    t->error = fmax(t->error, fabs(left) / match_surface_volume(t->surface));
    free(fresh);
    free(ids);
    mesh_fini(&mesh);
}

static enum result cut_by(struct touched *t, const struct blade_move *move, struct error *err) {
    struct convex *parts = alloc(CUT_PARTS_MAX, sizeof *parts);
    struct cut_change change = {0};
    int count = blade_parts(move, parts, err);
    enum cut_outcome outcome = count < 0 ? CUT_REFUSED : CUT_NOTHING;
    if (count > 0)
        outcome = cut_apply(t->cut, parts, count, &change, err);
    if (outcome == CUT_CHANGED)
        follow(t, &change);
    cut_change_fini(&change);
    free(parts);
    return outcome == CUT_REFUSED ? RESULT_REFUSED : RESULT_OK;
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
    struct mismatch_setting setting = {touched, cut, tear->parts, tear->part_count, COLUMN_MM};
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
    double *at = scene->is_resection ? &worst->share_resections : &worst->share_bites;
    *at = fmax(*at, share);
    worst->surface_p95_mm = fmax(worst->surface_p95_mm, samples_quantile(&apart[0], 0.95));
    worst->crossings += crossings_of(t);
    worst->error = fmax(worst->error, t->error);
    for (size_t i = 0; i < t->ms.count; i++)
        samples_add(&worst->ms, t->ms.values[i]);
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

static enum result play(const struct scene_of_cuts *scene, struct report *report,
                        struct touch_worst *worst, struct error *err) {
    struct touched t;
    enum result result = touched_init(&t, scene->group, err);
    for (int i = 0; result == RESULT_OK && i < scene->move_count; i++)
        result = cut_by(&t, &scene->moves[i], err);
    if (result == RESULT_OK)
        result = look_back(scene, &t, report, worst, err);
    touched_fini(&t);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", scene->name);
}

// ---- the scenes ---------------------------------------------------------------------------------

static enum result fifteen_bites(const struct knee_case *knee, struct report *report,
                                 struct touch_worst *worst, struct error *err) {
    struct meniscectomy m;
    enum result result = meniscectomy_init(&m, knee, err);
    if (result != RESULT_OK)
        return result;
    struct scene_of_cuts scene = {knee->name, m.group, m.bites, BITE_COUNT, false};
    result = play(&scene, report, worst, err);
    meniscectomy_fini(&m);
    return result;
}

static enum result resection(const char *recipe, struct report *report, struct touch_worst *worst,
                             struct error *err) {
    struct knee_case *knee;
    struct touch_moves moves;
    enum result result = touch_resection(recipe, &knee, &moves, err);
    if (result != RESULT_OK)
        return result;
    struct scene_of_cuts scene = {recipe, case_group(knee, moves.group), moves.moves, moves.count,
                                  true};
    result = scene.group ? play(&scene, report, worst, err)
                         : fail(err, RESULT_MISSING, "%s: nothing was cut", recipe);
    free(moves.moves);
    case_destroy(&knee);
    return result;
}

enum result touch_measure(const struct bench_options *options, struct report *report,
                          struct touch_worst *out_worst, struct error *err) {
    static const char *const recipes[] = {"tear-flap", "tear-radial", "tear-horizontal"};
    struct knee_case *knee;
    *out_worst = (struct touch_worst){0};
    enum result result = paper_knee("healthy", &knee, err);
    if (result == RESULT_OK) {
        result = fifteen_bites(knee, report, out_worst, err);
        case_destroy(&knee);
    }
    for (int i = 0; result == RESULT_OK && i < options->input_count; i++) {
        result = case_load(options->inputs[i], NULL, &knee, err);
        if (result != RESULT_OK)
            break;
        result = fifteen_bites(knee, report, out_worst, err);
        case_destroy(&knee);
    }
    int resections = options->quick ? 1 : 3;
    for (int i = 0; result == RESULT_OK && i < resections; i++)
        result = resection(recipes[i], report, out_worst, err);
    return result;
}
