#include "base/check.h"
#include "base/clock.h"
#include "cut.h"
#include "cutting/bites.h"
#include "cutting/crossings.h"
#include "cutting/inside.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const int lengths[3] = {15, 100, 300};

static const char *const kinds[BITE_KINDS] = {"nibble", "nearly the last", "through", "split"};

// Each so many changes random points look at the volume; a triangle less high is a sliver.
#define CHANGES_BETWEEN_ESTIMATES 25
#define ESTIMATE_POINTS 20000
#define SLIVER_MM 1e-3

struct measured {
    struct samples ms, own_ms, of_kind[BITE_KINDS]; // all in ms
    struct samples touched, delta_bytes, slivers[3], growth[3];
    int retries, nothing, pieces;
    int crossings_before, crossings[3];
    double whole_bytes;
};

void cut_count(struct cut_totals *totals, const struct trial *trial, const char *where, int cut) {
    totals->changes += trial->outcome == CUT_CHANGED;
    totals->failures += trial->outcome == CUT_REFUSED;
    totals->breaks += trial->fault != NULL;
    totals->retried += trial->change.retries > 0;
    const char *fault = trial->fault ? trial->fault : trial->err.text;
    if ((trial->fault || trial->outcome == CUT_REFUSED) && !*totals->first_fault)
        snprintf(totals->first_fault, sizeof totals->first_fault, "%s, cut %d: %s", where, cut,
                 fault);
}

static double sigmas_off(const struct trial *trial, const struct bite *bite, uint64_t seed) {
    struct random random = {seed};
    struct locator *locator = locator_create(&trial->before);
    struct estimate common =
        estimate_common(locator, bite->parts, bite->part_count, ESTIMATE_POINTS, &random);
    locator_destroy(&locator);
    return fabs(trial->change.removed_mm3 - common.volume) / common.sigma;
}

static double sliver_share(const struct snapshot *surface) {
    int slivers = 0;
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        if (!snapshot_has(surface, t))
            continue;
        vec3 c[3];
        snapshot_corners(surface, t, c);
        double area = vec3_length(vec3_cross(vec3_sub(c[1], c[0]), vec3_sub(c[2], c[0])));
        double longest = fmax(vec3_distance(c[0], c[1]),
                              fmax(vec3_distance(c[1], c[2]), vec3_distance(c[2], c[0])));
        slivers += area < SLIVER_MM * longest;
    }
    return (double)slivers / surface->triangle_count;
}

static void count_change(const struct trial *trial, const struct biter *biter,
                         struct measured *measured, struct cut_totals *totals) {
    const struct cut_change *change = &trial->change;
    double ms = 1e-6 * (double)trial->took_ns;
    samples_add(&measured->ms, ms);
    samples_add(&measured->own_ms, 1e-6 * (double)trial->own_ns);
    samples_add(&measured->of_kind[biter->kind], ms);
    samples_add(&measured->touched, change->freed_count + change->made_count);
    samples_add(&measured->delta_bytes, (double)cut_change_bytes(trial->mesh, change));
    measured->retries += change->retries;
    measured->pieces += change->piece_count;
    if (measured->ms.count % CHANGES_BETWEEN_ESTIMATES == 0)
        totals->sigma = fmax(totals->sigma, sigmas_off(trial, &biter->last, measured->ms.count));
}

static int larger(int a, int b) {
    return a > b ? a : b;
}

static void run(const struct cut_plan *plan, int length, uint64_t seed, struct measured *measured,
                struct cut_totals *totals) {
    struct trial trial;
    struct biter *biter = alloc(1, sizeof *biter);
    char where[80];
    int changes = 0;
    snprintf(where, sizeof where, "%s, %d changes, seed %d", plan->name, lengths[length],
             (int)seed);
    trial_init(&trial, plan->mesh);
    biter_init(biter, seed);
    for (int i = 0; i < 4 * lengths[length] && changes < lengths[length]; i++) {
        biter_next(biter, trial.mesh);
        trial_cut(&trial, biter->last.parts, biter->last.part_count);
        cut_count(totals, &trial, where, i);
        measured->nothing += trial.outcome == CUT_NOTHING;
        if (trial.outcome != CUT_CHANGED)
            continue;
        count_change(&trial, biter, measured, totals);
        changes++;
    }
    measured->crossings[length] =
        larger(measured->crossings[length], snapshot_crossings(&trial.now));
    samples_add(&measured->slivers[length], sliver_share(&trial.now));
    samples_add(&measured->growth[length],
                (double)trial.now.triangle_count / plan->mesh->triangle_count);
    free(biter);
    trial_fini(&trial);
}

// ---- report -------------------------------------------------------------------------------------

// What touches the whole mesh once, in ms: the reference beside the cuts.
static void report_reference(const struct cut_plan *plan, double cut_ms, struct report *report,
                             struct measured *measured) {
    struct samples copy = {0}, flatten = {0};
    struct cut_mesh *mesh;
    struct error err;
    CHECK(cut_mesh_create(plan->mesh, &mesh, &err) == RESULT_OK);
    measured->whole_bytes = (double)cut_mesh_bytes(mesh);
    for (int i = 0; i < 25; i++) {
        struct mesh flat;
        int64_t start = clock_now_ns();
        struct cut_mesh *other = cut_mesh_copy(mesh);
        int64_t copied = clock_now_ns();
        cut_mesh_flatten(mesh, &flat, NULL, NULL);
        samples_add(&copy, 1e-6 * (double)(copied - start));
        samples_add(&flatten, 1e-6 * (double)(clock_now_ns() - copied));
        cut_mesh_destroy(&other);
        mesh_fini(&flat);
    }
    double copy_ms = samples_quantile(&copy, 0.5);
    report_figure(report, copy_ms, "ms", "%s/reference: copy of the mesh", plan->name);
    report_figure(report, samples_quantile(&flatten, 0.5), "ms", "%s/reference: flat arrays",
                  plan->name);
    report_figure(report, cut_ms / copy_ms, "times", "%s/cut over copy", plan->name);
    cut_mesh_destroy(&mesh);
    samples_fini(&copy);
    samples_fini(&flatten);
}

static void report_lengths(const struct cut_plan *plan, struct report *report,
                           struct measured *measured) {
    for (int i = 0; i < 3; i++) {
        if (!plan->sequences[i])
            continue;
        report_figure(report, measured->crossings[i], "pairs", "%s/%d/self-intersections, most",
                      plan->name, lengths[i]);
        report_figure(report, samples_max(&measured->slivers[i]), "of triangles",
                      "%s/%d/slivers, most", plan->name, lengths[i]);
        report_figure(report, samples_mean(&measured->growth[i]), "times",
                      "%s/%d/growth of triangles", plan->name, lengths[i]);
        samples_fini(&measured->slivers[i]);
        samples_fini(&measured->growth[i]);
    }
}

static void report_cuts(const struct cut_plan *plan, struct report *report,
                        struct measured *measured) {
    const char *name = plan->name;
    double p50 = samples_quantile(&measured->ms, 0.5);
    report_figure(report, (double)measured->ms.count, "cuts", "%s/changes", name);
    report_figure(report, measured->nothing, "cuts", "%s/cuts of nothing", name);
    report_figure(report, measured->pieces, "pieces", "%s/pieces", name);
    report_figure(report, measured->retries, "retries", "%s/retries", name);
    report_figure(report, measured->crossings_before, "pairs",
                  "%s/self-intersections before any cut", name);
    report_figure(report, p50, "ms", "%s/p50", name);
    report_figure(report, samples_quantile(&measured->ms, 0.95), "ms", "%s/p95", name);
    report_figure(report, samples_max(&measured->ms), "ms", "%s/max", name);
    report_figure(report, samples_quantile(&measured->own_ms, 0.5), "ms",
                  "%s/thread's own time/p50", name);
    report_figure(report, samples_quantile(&measured->own_ms, 0.95), "ms",
                  "%s/thread's own time/p95", name);
    report_figure(report, samples_max(&measured->own_ms), "ms", "%s/thread's own time/max", name);
    for (int kind = 0; kind < BITE_KINDS; kind++) {
        report_figure(report, samples_quantile(&measured->of_kind[kind], 0.5), "ms", "%s/%s/p50",
                      name, kinds[kind]);
        samples_fini(&measured->of_kind[kind]);
    }
    report_figure(report, samples_quantile(&measured->touched, 0.5), "triangles",
                  "%s/triangles freed and made, p50", name);
    report_reference(plan, p50, report, measured);
    report_figure(report, samples_quantile(&measured->delta_bytes, 0.5), "bytes",
                  "%s/message of a change, p50", name);
    report_figure(report, samples_quantile(&measured->delta_bytes, 0.95), "bytes",
                  "%s/message of a change, p95", name);
    report_figure(report, measured->whole_bytes, "bytes", "%s/message of the mesh", name);
    report_lengths(plan, report, measured);
}

static void add_to_totals(const struct cut_plan *plan, struct measured *measured,
                          struct cut_totals *totals) {
    if (!measured->crossings_before) { // where a scan folds, what is cut out of it folds as well
        totals->crossings_15 = larger(totals->crossings_15, measured->crossings[0]);
        totals->crossings_300 = larger(totals->crossings_300, measured->crossings[2]);
    }
    if (plan->is_timed) {
        totals->p50_ms = fmax(totals->p50_ms, samples_quantile(&measured->own_ms, 0.5));
        totals->p95_ms = fmax(totals->p95_ms, samples_quantile(&measured->own_ms, 0.95));
        totals->max_ms = fmax(totals->max_ms, samples_max(&measured->own_ms));
    }
    for (size_t i = 0; i < measured->delta_bytes.count && plan->is_20k; i++)
        samples_add(&totals->delta_share, measured->delta_bytes.values[i] / measured->whole_bytes);
}

static int crossings_of(const struct mesh *mesh) {
    struct snapshot snapshot;
    snapshot_of_mesh(mesh, &snapshot);
    int crossings = snapshot_crossings(&snapshot);
    snapshot_fini(&snapshot);
    return crossings;
}

void cut_sequences(const struct cut_plan *plan, struct report *report, struct cut_totals *totals) {
    struct measured measured = {.crossings_before = crossings_of(plan->mesh)};
    for (int length = 0; length < 3; length++)
        for (int i = 0; i < plan->sequences[length]; i++)
            run(plan, length, (uint64_t)(1000 * lengths[length] + i), &measured, totals);
    report_cuts(plan, report, &measured);
    add_to_totals(plan, &measured, totals);
    samples_fini(&measured.ms);
    samples_fini(&measured.own_ms);
    samples_fini(&measured.touched);
    samples_fini(&measured.delta_bytes);
}
