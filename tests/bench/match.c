#include "match/match.h"

#include "base/clock.h"
#include "bench.h"
#include "bisection.h"
#include "cut/cut.h"
#include "generate/maxcut.h"
#include "generate/tube.h"
#include "mesh/query.h"
#include "random.h"
#include "samples.h"
#include "touch.h"

#include <stdlib.h>
#include <string.h>

#define MENISCUS_MM3 2360.0
#define RIM_MM 4.0
#define PATCHES_MAX 16

struct size {
    const char *name;
    double edge_mm;
};

static const struct size sizes[] = {{"5k", 1}, {"20k", 0.5}};

enum method { OURS, BISECTION, COARSE_BISECTION, METHOD_COUNT };

#define BISECTIONS (METHOD_COUNT - 1)

// Tolerances are shares of the whole volume.
static const struct {
    const char *name;
    double tolerance;
} methods[METHOD_COUNT] = {{"match", 0}, {"bisection to 1e-9", 1e-9}, {"bisection to 1e-6", 1e-6}};

struct measured {
    struct samples ms[METHOD_COUNT], times, steps, changed, error, error_of_removed, apart_mm;
    int nibbles, widened, saturated;
    double removed_mm3, left_mm3;
};

static void measured_fini(struct measured *measured) {
    for (int i = 0; i < METHOD_COUNT; i++)
        samples_fini(&measured->ms[i]);
    samples_fini(&measured->times);
    samples_fini(&measured->steps);
    samples_fini(&measured->changed);
    samples_fini(&measured->error);
    samples_fini(&measured->error_of_removed);
    samples_fini(&measured->apart_mm);
}

// ---- by blends: real cuts into a generated meniscus ---------------------------------------------

// A meniscus, cut, and what each method makes of it.
struct resection {
    struct cut_mesh *cut;
    struct match *match;
    struct bisection *bisections[BISECTIONS];
};

static enum result resection_init(struct resection *out, const struct case_group *group,
                                  const struct match_surface *surface, struct error *err) {
    out->match = match_create(surface);
    for (int i = 0; i < BISECTIONS; i++)
        out->bisections[i] = bisection_create(&group->mesh, NULL, group->maxcut);
    out->cut = NULL;
    return cut_mesh_create(&group->mesh, &out->cut, err);
}

static void resection_fini(struct resection *resection) {
    match_destroy(&resection->match);
    for (int i = 0; i < BISECTIONS; i++)
        bisection_destroy(&resection->bisections[i]);
    cut_mesh_destroy(&resection->cut);
}

// Where there is still something to take: on the way of a vertex, near where it is now.
static vec3 bite_centre(const struct case_group *group, const struct match *match,
                        struct random *r) {
    for (;;) {
        uint32_t v = (uint32_t)(random_bits(r) % group->mesh.vertex_count);
        const float *d = group->maxcut + 3 * (size_t)v;
        double left = 1 - match_blends(match)[v];
        vec3 way = {left * (double)d[0], left * (double)d[1], left * (double)d[2]};
        if (vec3_length(way) > 0.3)
            return vec3_add_scaled(match_vertex(match, v), random_between(r, 0, 0.5), way);
    }
}

static enum result make_bite(vec3 centre, struct random *r, struct convex *out, struct error *err) {
    struct plane planes[6];
    quat turn = random_pose(r, 0).rotation;
    for (int i = 0; i < 6; i++) {
        vec3 axis = {i / 2 == 0, i / 2 == 1, i / 2 == 2};
        vec3 normal = quat_rotate(turn, vec3_scale(i % 2 ? 1 : -1, axis));
        planes[i] = (struct plane){normal, vec3_dot(normal, centre) + random_between(r, 0.7, 2)};
    }
    return convex_create(planes, 6, out, err);
}

// ---- matching -----------------------------------------------------------------------------------

static void match_by(struct resection *resection, int method, const struct brush *brushes,
                     int count, double target, struct match_report *out) {
    if (method == OURS)
        match_to_volume(resection->match, brushes, count, target, out);
    else
        bisection_match(resection->bisections[method - 1], brushes, count, target,
                        methods[method].tolerance * MENISCUS_MM3, out);
}

static void measured_error(struct measured *measured, const struct match *match, double target,
                           double removed) {
    double error = fabs(match_volume(match) - target);
    samples_add(&measured->error, error / MENISCUS_MM3);
    samples_add(&measured->error_of_removed, error / removed);
}

static void match_nibble(struct resection *resection, const struct cut_change *change,
                         double removed, struct measured *measured) {
    struct brush brushes[PATCHES_MAX];
    int count = change->patch_count < PATCHES_MAX ? change->patch_count : PATCHES_MAX;
    for (int i = 0; i < count; i++)
        brushes[i] = (struct brush){change->patches[i].centroid, change->patches[i].extent};
    struct match_report reports[METHOD_COUNT];
    double ms[METHOD_COUNT];
    for (int i = 0; i < METHOD_COUNT; i++) {
        int64_t before = clock_now_ns();
        match_by(resection, i, brushes, count, change->volume_mm3, &reports[i]);
        ms[i] = 1e-6 * (double)(clock_now_ns() - before);
        samples_add(&measured->ms[i], ms[i]);
    }
    measured->nibbles++;
    measured->widened += reports[OURS].widening > 1;
    samples_add(&measured->changed, reports[OURS].changed_count);
    samples_add(&measured->steps, reports[OURS].steps);
    if (reports[OURS].outcome == MATCH_SATURATED) {
        measured->saturated++;
        return;
    }
    samples_add(&measured->times, ms[BISECTION] / ms[OURS]);
    measured_error(measured, resection->match, change->volume_mm3, removed);
}

// How far the surface that the cuts made is from S''.
static enum result measure_apart(const struct resection *resection, const struct mesh *mesh,
                                 struct measured *measured, struct error *err) {
    struct mesh warped;
    struct query *query = NULL;
    mesh_copy(&warped, mesh);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh_set_vertex(&warped, v, match_vertex(resection->match, v));
    enum result result = query_create(&warped, &query, err);
    const struct cut_mesh *cut = resection->cut;
    for (uint32_t t = 0; result == RESULT_OK && t < cut_mesh_triangle_bound(cut); t++) {
        if (!cut_mesh_triangle_alive(cut, t) || !cut_mesh_label(cut, t))
            continue;
        const uint32_t *v = cut_mesh_triangle(cut, t);
        vec3 p = vec3_add(cut_mesh_vertex(cut, v[0]), cut_mesh_vertex(cut, v[1]));
        p = vec3_scale(1.0 / 3, vec3_add(p, cut_mesh_vertex(cut, v[2])));
        struct closest closest;
        query_closest(query, p, INFINITY, MESH_NONE, &closest);
        samples_add(&measured->apart_mm, closest.distance);
    }
    query_destroy(&query);
    mesh_fini(&warped);
    return result;
}

// Until nine tenths of what may go have gone.
static enum result resect(const struct case_group *group, const struct match_surface *surface,
                          struct random *r, struct measured *measured, struct error *err) {
    struct resection resection;
    double whole = match_surface_volume(surface), least = match_surface_least(surface);
    double volume = whole;
    enum result result = resection_init(&resection, group, surface, err);
    for (int i = 0; i < 200 && result == RESULT_OK && volume > 0.1 * whole + 0.9 * least; i++) {
        struct convex bite;
        result = make_bite(bite_centre(group, resection.match, r), r, &bite, err);
        struct cut_change change = {0};
        if (result != RESULT_OK || cut_apply(resection.cut, &bite, 1, &change, err) != CUT_CHANGED)
            continue;
        match_nibble(&resection, &change, volume - change.volume_mm3, measured);
        volume = change.volume_mm3;
        cut_change_fini(&change);
    }
    if (result == RESULT_OK)
        result = measure_apart(&resection, &group->mesh, measured, err);
    measured->removed_mm3 += whole - volume;
    measured->left_mm3 += match_volume(resection.match) - volume;
    resection_fini(&resection);
    return result;
}

static enum result resect_size(const struct size *size, int resections, struct measured *measured,
                               struct error *err) {
    struct case_group group = {.name = "meniscus_medial", .body = BODY_TIBIA, .cuttable = true};
    if (!tube_meniscus(false, MENISCUS_MM3, size->edge_mm, &group.mesh))
        return fail(err, RESULT_INVALID, "no meniscus of %g mm³", MENISCUS_MM3);
    struct match_surface *surface = NULL;
    enum result result = maxcut_make(&group, pose_identity(), RIM_MM, err);
    if (result == RESULT_OK)
        surface = match_surface_create(&group.mesh, NULL, group.maxcut);
    for (uint64_t seed = 1; result == RESULT_OK && seed <= (uint64_t)resections; seed++) {
        struct random r = {seed};
        result = resect(&group, surface, &r, measured, err);
    }
    match_surface_destroy(&surface);
    free(group.maxcut);
    mesh_fini(&group.mesh);
    return result;
}

// ---- the report ---------------------------------------------------------------------------------

static void report_size(struct report *report, const char *size, struct measured *measured) {
    for (int i = 0; i < METHOD_COUNT; i++) {
        report_figure(report, samples_quantile(&measured->ms[i], 0.5), "ms", "%s/%s/p50", size,
                      methods[i].name);
        report_figure(report, samples_quantile(&measured->ms[i], 0.95), "ms", "%s/%s/p95", size,
                      methods[i].name);
    }
    report_figure(report, samples_quantile(&measured->times, 0.05), "times",
                  "%s/bisection over match/p5", size);
    report_figure(report, measured->nibbles, "nibbles", "%s/changing cuts", size);
    report_figure(report, samples_quantile(&measured->steps, 0.5), "steps", "%s/steps/p50", size);
    report_figure(report, samples_max(&measured->steps), "steps", "%s/steps/largest", size);
    report_figure(report, samples_quantile(&measured->changed, 0.5), "vertices", "%s/changed/p50",
                  size);
    report_figure(report, (double)measured->widened / measured->nibbles, "share", "%s/widened",
                  size);
    report_figure(report, (double)measured->saturated / measured->nibbles, "share", "%s/saturated",
                  size);
    report_figure(report, measured->left_mm3 / measured->removed_mm3, "share",
                  "%s/left at the end, of all removed", size);
    report_figure(report, samples_quantile(&measured->apart_mm, 0.5), "mm",
                  "%s/cut surface to S''/p50", size);
    report_figure(report, samples_quantile(&measured->apart_mm, 0.95), "mm",
                  "%s/cut surface to S''/p95", size);
    report_figure(report, samples_max(&measured->error), "of V", "%s/error/largest", size);
    report_figure(report, samples_max(&measured->error_of_removed), "of it",
                  "%s/error of the bite/largest", size);
}

// Fitted, as sessions are now.
static enum result bench_touch(const struct bench_options *options, struct report *report,
                               struct error *err) {
    struct touch_worst worst;
    enum result result = touch_measure(options, report, &worst, err);
    if (result == RESULT_OK) {
        report_mark(report, "mismatch_15_share", worst.share[SCENE_BITES], "of the cut", 0.05,
                    BETTER_LOW);
        report_mark(report, "mismatch_resect_share", worst.share[SCENE_RESECTION], "of the cut",
                    0.1, BETTER_LOW);
        report_mark(report, "surface_p95_mm", worst.surface_p95_mm, "mm", 0.3, BETTER_LOW);
        report_mark(report, "touch_crossings", worst.crossings, "pairs", 0, BETTER_LOW);
        report_mark(report, "match_ms_20k_p50", worst.p50_ms, "ms", 15, BETTER_LOW);
        report_mark(report, "match_rel_error_max", worst.error, "of V", 1e-9, BETTER_LOW);
    }
    return result;
}

enum result bench_match(const struct bench_options *options, struct report *report,
                        struct error *err) {
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct measured measured = {0};
        enum result result = resect_size(&sizes[i], options->quick ? 5 : 40, &measured, err);
        if (result == RESULT_OK)
            report_size(report, sizes[i].name, &measured);
        measured_fini(&measured);
        if (result != RESULT_OK)
            return result;
    }
    return bench_touch(options, report, err);
}
