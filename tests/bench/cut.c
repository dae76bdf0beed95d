#include "cut.h"

#include "case/case.h"
#include "cut_session.h"
#include "cutting/specimens.h"
#include "cutting/voxels.h"
#include "fine_knee.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *name;
    int triangles, sequences[3], quick_sequences[3];
} sizes[] = {
    {"5k", 5000, {100, 12, 4}, {12, 1, 1}},
    {"20k", 20000, {100, 12, 4}, {12, 1, 1}},
    {"80k", 80000, {40, 6, 4}, {3, 1, 0}},
};

static const int case_sequences[3] = {10, 2, 1}, case_quick_sequences[3] = {2, 0, 0};

static void measure_sizes(bool quick, struct report *report, struct cut_totals *totals) {
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct mesh mesh;
        bool is_20k = !strcmp(sizes[i].name, "20k");
        struct cut_plan plan = {sizes[i].name, &mesh, is_20k, is_20k, {0}};
        memcpy(plan.sequences, quick ? sizes[i].quick_sequences : sizes[i].sequences,
               sizeof plan.sequences);
        specimen_meniscus(&mesh, false, sizes[i].triangles);
        cut_sequences(&plan, report, totals);
        if (is_20k) {
            cut_instruments(&mesh, quick ? 60 : 600, report, totals);
            cut_by_knife(plan.name, &mesh, quick ? 60 : 600, report, totals);
        }
        mesh_fini(&mesh);
    }
}

static enum result measure_case(const char *dir, bool quick, struct report *report,
                                struct cut_totals *totals, struct error *err) {
    struct knee_case *knee;
    enum result result = case_load(dir, NULL, &knee, err);
    if (result != RESULT_OK)
        return result;
    int cuttable = 0;
    for (int i = 0; i < knee->group_count; i++) {
        if (!knee->groups[i].cuttable)
            continue;
        char name[2 * CASE_NAME_MAX];
        struct mesh mesh;
        struct cut_plan plan = {name, &mesh, true, false, {0}};
        memcpy(plan.sequences, quick ? case_quick_sequences : case_sequences,
               sizeof plan.sequences);
        snprintf(name, sizeof name, "%s/%s", knee->name, knee->groups[i].name);
        case_group_virtual(&knee->groups[i], &mesh);
        cut_sequences(&plan, report, totals);
        mesh_fini(&mesh);
        cuttable++;
    }
    case_destroy(&knee);
    return cuttable ? RESULT_OK : fail(err, RESULT_MISSING, "case %s: nothing is cuttable", dir);
}

static enum result measure_lesions(const struct bench_options *options, struct report *report,
                                   struct cut_totals *totals, struct error *err) {
    enum result result = RESULT_OK;
    int lesions = options->quick ? 1 : FINE_LESIONS;
    for (int i = 0; result == RESULT_OK && i < lesions; i++) {
        result = cut_lesion(NULL, fine_lesions[i], options->quick, report, totals, err);
        for (int k = 0; result == RESULT_OK && k < options->input_count; k++)
            result = cut_lesion(options->inputs[k], fine_lesions[i], options->quick, report, totals,
                                err);
    }
    return result;
}

// Cubes minus boxes on a lattice, whose volumes can be counted.
static double measure_lattice(int sequences, struct report *report, struct cut_totals *totals) {
    double volume_error = 0, area_error = 0;
    int cuts = 0;
    for (int seed = 1; seed <= sequences; seed++) {
        struct voxel_run run = voxel_sequence((uint64_t)seed, 25);
        volume_error = fmax(volume_error, run.volume_error);
        area_error = fmax(area_error, run.area_error);
        cuts += run.cuts;
        totals->breaks += run.fault != NULL;
        if (run.fault && !*totals->first_fault)
            snprintf(totals->first_fault, sizeof totals->first_fault, "lattice, seed %d: %s", seed,
                     run.fault);
    }
    report_figure(report, cuts, "cuts", "lattice/changes");
    report_figure(report, area_error, "mm2", "lattice/largest error of the surface's area");
    return volume_error;
}

static void mark_totals(struct cut_totals *totals, struct report *report) {
    double changes = totals->changes;
    report_figure(report, changes, "cuts", "cuts that changed a mesh");
    report_mark(report, "cut_failures", totals->failures, "cuts", 0, BETTER_LOW);
    report_mark(report, "cut_invariant_breaks", totals->breaks, "cuts", 0, BETTER_LOW);
    report_mark(report, "cut_retry_share", totals->retried / changes, "of cuts", 0.001, BETTER_LOW);
    report_mark(report, "cut_volume_sigma_max", totals->sigma, "sigma", 4, BETTER_LOW);
    report_mark(report, "cut_ms_20k_p50", totals->p50_ms, "ms", 1, BETTER_LOW);
    report_mark(report, "cut_ms_20k_p95", totals->p95_ms, "ms", 1, BETTER_LOW);
    report_mark(report, "cut_ms_20k_max", totals->max_ms, "ms", 5, BETTER_LOW);
    report_mark(report, "knife_ms_20k_p95", totals->knife_p95_ms, "ms", 3.5, BETTER_LOW);
    report_mark(report, "job_over_cut_and_match", totals->job_over_kernels, "times", 1.2,
                BETTER_LOW);
    report_mark(report, "cut_self_intersections_15", totals->crossings_15, "pairs", 0, BETTER_LOW);
    report_mark(report, "cut_self_intersections_300", totals->crossings_300, "pairs", 20,
                BETTER_LOW);
    report_mark(report, "cut_delta_share_p50", samples_quantile(&totals->delta_share, 0.5),
                "of the mesh", 0.03, BETTER_LOW);
    if (*totals->first_fault)
        report_text(report, "first fault", totals->first_fault);
    samples_fini(&totals->delta_share);
}

enum result bench_cut(const struct bench_options *options, struct report *report,
                      struct error *err) {
    struct cut_totals totals = {0};
    bool quick = options->quick;
    for (int i = 0; i < options->input_count; i++) {
        enum result result = measure_case(options->inputs[i], quick, report, &totals, err);
        if (result != RESULT_OK)
            return result;
    }
    measure_sizes(quick, report, &totals);
    enum result result = measure_lesions(options, report, &totals, err);
    if (result != RESULT_OK)
        return result;
    double lattice_error = measure_lattice(quick ? 60 : 300, report, &totals);
    double growth = cut_growth_far(quick ? 150 : 600, report, &totals);
    mark_totals(&totals, report);
    report_mark(report, "cut_degenerate_volume_error_mm3", lattice_error, "mm3", 0.01, BETTER_LOW);
    report_mark(report, "cut_growth_far", growth, "times", 1.5, BETTER_LOW);
    return bench_cut_session(options, report, err);
}
