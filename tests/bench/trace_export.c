#include "trace_export.h"

#include "base/clock.h"
#include "export/export.h"
#include "replay/roundtrip.h"

#include <math.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

static double megabytes(const char *path) {
    struct stat status;
    return stat(path, &status) == 0 ? (double)status.st_size / 1e6 : NAN;
}

// By bytes of the record that went in.
static void report_speed(struct report *report, const char *trace, const char *made,
                         const char *name, int64_t begin_ns) {
    double seconds = (double)(clock_now_ns() - begin_ns) / NS_PER_S;
    report_figure(report, megabytes(trace) / seconds, "MB/s", "export/%s", name);
    report_figure(report, megabytes(made) / megabytes(trace), "of the trace", "export/%s_size",
                  name);
}

static enum result bench_exr(const struct export_request *request, const char *path,
                             struct report *report, struct error *err) {
    struct exr_parts parts;
    struct roundtrip trip = {0};
    int64_t begin_ns = clock_now_ns();
    enum result result = export_exr(request, path, err);
    if (result != RESULT_OK)
        return result;
    report_speed(report, request->trace, path, "exr", begin_ns);
    result = exr_parts_read(path, &parts, err);
    unlink(path);
    if (result != RESULT_OK)
        return result;
    roundtrip_fields(&parts, request->trace, &trip);
    roundtrip_maps(&parts, request->trace, request->scene, &trip);
    exr_parts_fini(&parts);
    report_figure(report, (double)trip.values, "values", "export/exr_compared");
    report_figure(report, (double)trip.maps, "maps", "export/exr_maps");
    report_mark(report, "exr_roundtrip_differences", (double)trip.differences, "values", 0,
                BETTER_LOW);
    return RESULT_OK;
}

static enum result bench_gltf(const struct export_request *request, const char *path,
                              struct report *report, struct error *err) {
    int64_t begin_ns = clock_now_ns();
    enum result result = export_gltf(request, path, err);
    if (result == RESULT_OK)
        report_speed(report, request->trace, path, "gltf", begin_ns);
    unlink(path);
    return result;
}

static enum result bench_csv(const struct export_request *request, const char *path,
                             struct report *report, struct error *err) {
    FILE *file = fopen(path, "we");
    if (!file)
        return fail(err, RESULT_IO, "%s cannot be written", path);
    int64_t begin_ns = clock_now_ns();
    enum result result = export_csv(request, file, err);
    fclose(file);
    if (result == RESULT_OK)
        report_speed(report, request->trace, path, "csv", begin_ns);
    unlink(path);
    return result;
}

enum result bench_export(const char *trace, const struct scene *scene, struct report *report,
                         struct error *err) {
    struct export_request request = {
        .trace = trace, .from_s = -INFINITY, .to_s = INFINITY, .scene = scene};
    char path[512];
    snprintf(path, sizeof path, "%s.export", trace);
    enum result result = bench_exr(&request, path, report, err);
    if (result == RESULT_OK)
        result = bench_gltf(&request, path, report, err);
    if (result == RESULT_OK)
        result = bench_csv(&request, path, report, err);
    return result;
}
