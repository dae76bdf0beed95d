#include "base/check.h"
#include "cut.h"
#include "kernel_time.h"
#include "step/operation.h"
#include "step/session.h"

#include <string.h>

static int tissue_of(const struct scene *scene, const char *group) {
    for (int i = 0; i < scene_tissue_count(scene); i++)
        if (!strcmp(scene_case(scene)->groups[scene_tissue_group(scene, i)].name, group))
            return i;
    return 0;
}

void cut_jobs(const struct cut_resection *resection, struct report *report,
              struct cut_totals *totals) {
    const struct session_settings settings = session_settings_default();
    struct operation *operation =
        operation_create(resection->scene, settings.rules, instruments_usual());
    struct job job = {.kind = JOB_CUT, .move_count = 1};
    struct samples ms = {0}, fit_ms = {0};
    double all_ms = 0, kernels_ms = 0;
    job.tissue = tissue_of(resection->scene, resection->moves->group);
    for (int i = 0; i < resection->moves->count; i++) {
        struct kernel_time before = kernel_time_of_thread();
        job.id = job.stroke = (uint32_t)i + 1;
        job.moves[0] = resection->moves->moves[i];
        double begin = thread_ms();
        struct job_result *result = operation_run(operation, &job);
        double took_ms = thread_ms() - begin;
        struct kernel_time after = kernel_time_of_thread();
        if (result->outcome == JOB_DONE) {
            samples_add(&ms, took_ms);
            samples_add(&fit_ms, after.fit_ms - before.fit_ms);
            all_ms += took_ms;
            kernels_ms += after.cut_ms - before.cut_ms + after.fit_ms - before.fit_ms;
        }
        job_result_destroy(&result);
    }
    const char *name = resection->name;
    report_figure(report, (double)ms.count, "jobs", "%s/jobs", name);
    report_figure(report, samples_quantile(&ms, 0.5), "ms", "%s/job/p50", name);
    report_figure(report, samples_quantile(&ms, 0.95), "ms", "%s/job/p95", name);
    report_figure(report, samples_quantile(&fit_ms, 0.5), "ms", "%s/job/match/p50", name);
    report_figure(report, all_ms / kernels_ms, "times", "%s/job/over cut and match", name);
    totals->job_over_kernels = fmax(totals->job_over_kernels, all_ms / kernels_ms);
    samples_fini(&ms);
    samples_fini(&fit_ms);
    operation_destroy(&operation);
}
