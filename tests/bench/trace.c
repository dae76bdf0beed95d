#include "base/clock.h"
#include "bench.h"
#include "samples.h"
#include "scene/played.h"
#include "trace/replay.h"
#include "trace_export.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

// Records that a replay finds different, or cannot reach.
static double differences(const struct replay_report *r) {
    bool reached_all = r->end == RESULT_CLOSED || r->end == RESULT_MISSING;
    return (double)(r->different + r->left_out) + (reached_all ? 0 : 1);
}

static enum result replay_on(const char *path, const struct scene *scene, const char *name,
                             struct report *report, double *differences_sum, struct error *err) {
    struct trace_reader *reader;
    struct replay_report replay;
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    int64_t begin_ns = clock_now_ns();
    result = trace_replay(reader, scene, NULL, NULL, &replay, err);
    double taken_ns = (double)(clock_now_ns() - begin_ns);
    trace_reader_destroy(&reader);
    if (result != RESULT_OK)
        return result;
    *differences_sum += differences(&replay);
    report_text(report, name, replay_verdict_name(replay.verdict));
    report_figure(report, (double)replay.steps, "steps", "%s/replayed", name);
    report_figure(report, (double)replay.session_ns / taken_ns, "times real time", "%s/speed",
                  name);
    report_figure(report, taken_ns / 1e3 / (double)replay.steps, "us", "%s/step", name);
    return RESULT_OK;
}

// ---- a session of the bench's own ----

struct recording {
    struct trace_writer *writer;
    struct samples append_ns;
};

static void append(void *context, const struct session_input *input,
                   const struct session_output *output) {
    struct recording *r = context;
    int64_t begin_ns = clock_now_ns();
    trace_append(r->writer, input, output);
    samples_add(&r->append_ns, (double)(clock_now_ns() - begin_ns));
    if (r->append_ns.count % 500 == 0) // a disk cannot keep up with two million steps a second
        nanosleep(&(struct timespec){.tv_nsec = 25 * NS_PER_MS}, NULL);
}

static enum result record(const struct played *played, const char *path, struct report *report,
                          struct error *err) {
    struct recording r = {0};
    struct trace_header header = {
        .case_name = "arthrosis",
        .case_hash = scene_case(played->scene)->hash,
        .settings = session_settings_default(),
    };
    trace_header_set_machine(&header);
    enum result result = trace_writer_create(path, &header, NULL, &r.writer, err);
    if (result != RESULT_OK)
        return result;
    played_run(played, &header.settings, played->motion.row_count, append, &r);
    struct trace_status status = trace_writer_status(r.writer);
    trace_writer_destroy(&r.writer);
    report_figure(report, 1e9 / samples_mean(&r.append_ns), "records/s", "append/rate");
    report_figure(report, samples_quantile(&r.append_ns, 0.5), "ns", "append/p50");
    report_figure(report, samples_quantile(&r.append_ns, 0.99), "ns", "append/p99");
    report_figure(report, samples_max(&r.append_ns), "ns", "append/max");
    report_figure(report, (double)status.missing, "steps", "append/missing");
    samples_fini(&r.append_ns);
    return RESULT_OK;
}

static enum result bench_own_session(const char *folder, struct report *report,
                                     double *differences_sum, struct error *err) {
    char case_dir[64], path[64], file[96];
    struct played played;
    snprintf(case_dir, sizeof case_dir, "%s/case", folder);
    snprintf(path, sizeof path, "%s/session.trace", folder);
    enum result result = played_init(CASES, "arthrosis", case_dir, &played, err);
    if (result != RESULT_OK)
        return result;
    result = record(&played, path, report, err);
    if (result == RESULT_OK)
        result = replay_on(path, played.scene, "palpation", report, differences_sum, err);
    if (result == RESULT_OK)
        result = bench_export(path, played.scene, report, err);
    played_fini(&played);
    unlink(path);
    static const char *const files[] = {"case.json", "anatomy.glb"};
    for (int i = 0; i < 2; i++) {
        snprintf(file, sizeof file, "%s/%s", case_dir, files[i]);
        unlink(file);
    }
    rmdir(case_dir);
    return result;
}

// ---- a trace that is there ----

static enum result bench_file(const char *path, struct report *report, double *differences_sum,
                              struct error *err) {
    struct trace_reader *reader;
    struct knee_case *knee;
    struct scene *scene = NULL;
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    result = case_load(trace_reader_header(reader)->case_dir, NULL, &knee, err);
    trace_reader_destroy(&reader);
    if (result == RESULT_OK && (result = scene_create(&knee, &scene, err)) != RESULT_OK)
        case_destroy(&knee);
    if (result == RESULT_OK)
        result = replay_on(path, scene, path, report, differences_sum, err);
    scene_destroy(&scene);
    return result;
}

enum result bench_trace(const struct bench_options *options, struct report *report,
                        struct error *err) {
    double differences_sum = 0;
    enum result result = RESULT_OK;
    char folder[] = "/tmp/arthron-bench-XXXXXX";
    for (int i = 0; result == RESULT_OK && i < options->input_count; i++)
        result = bench_file(options->inputs[i], report, &differences_sum, err);
    if (!options->input_count) {
        if (!mkdtemp(folder))
            return fail(err, RESULT_IO, "cannot make a folder below /tmp");
        result = bench_own_session(folder, report, &differences_sum, err);
        rmdir(folder);
    }
    if (result == RESULT_OK)
        report_mark(report, "replay_differences", differences_sum, "steps", 0, BETTER_LOW);
    return result;
}
