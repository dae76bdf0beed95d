#include "base/check.h"
#include "base/clock.h"
#include "bench.h"
#include "folder.h"
#include "samples.h"
#include "scene/played.h"
#include "trace/replay.h"
#include "trace_export.h"
#include "trace_parts.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

// Records that a replay finds different, or cannot reach.
static double differences(const struct replay_report *r) {
    bool reached_all = r->end == RESULT_CLOSED || r->end == RESULT_MISSING;
    return (double)(r->different + r->left_out) + (reached_all ? 0 : 1);
}

struct sums {
    double differences, resume_differences, other_cpu_mm, slowest; // the least speed of a replay
};

static enum result replay_once(const char *path, const struct scene *scene,
                               struct replay_report *out_replay, struct error *err) {
    struct trace_reader *reader;
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    result = trace_replay(reader, scene, NULL, NULL, out_replay, err);
    trace_reader_destroy(&reader);
    return result;
}

static enum result replay_on(const char *path, const struct scene *scene, const char *name,
                             struct report *report, struct sums *sums, struct error *err) {
    struct replay_report replay;
    int64_t begin_ns = clock_now_ns();
    enum result result = replay_once(path, scene, &replay, err);
    double taken_ns = (double)(clock_now_ns() - begin_ns);
    if (result != RESULT_OK)
        return result;
    double speed = (double)replay.session_ns / taken_ns;
    sums->differences += differences(&replay);
    sums->slowest = fmin(sums->slowest, speed);
    report_text(report, name, replay_verdict_name(replay.verdict));
    report_figure(report, (double)replay.steps, "steps", "%s/replayed", name);
    report_figure(report, speed, "times real time", "%s/speed", name);
    report_figure(report, taken_ns / 1e3 / (double)replay.steps, "us", "%s/step", name);
    return RESULT_OK;
}

// ---- beside others ------------------------------------------------------------------------------

struct beside {
    const char *path;
    const struct scene *scene;
    pthread_t thread;
    enum result result;
    struct error err;
    struct replay_report replay;
};

static void *replay_beside(void *context) {
    struct beside *b = context;
    b->result = replay_once(b->path, b->scene, &b->replay, &b->err);
    return NULL;
}

// As many at once as a server with so many workers runs.
static enum result replay_side_by_side(const char *path, const struct scene *scene, int count,
                                       struct sums *sums, struct error *err) {
    static struct beside all[4];
    enum result result = RESULT_OK;
    for (int i = 0; i < count; i++) {
        all[i] = (struct beside){.path = path, .scene = scene};
        CHECK(pthread_create(&all[i].thread, NULL, replay_beside, &all[i]) == 0);
    }
    for (int i = 0; i < count; i++) {
        pthread_join(all[i].thread, NULL);
        if (all[i].result != RESULT_OK)
            result = fail(err, all[i].result, "%s", all[i].err.text);
        else
            sums->differences += differences(&all[i].replay);
    }
    return result;
}

// In all the ways that must make no difference.
static enum result replay_everywhere(const char *path, const struct scene *scene,
                                     const char *case_dir, bool quick, struct sums *sums,
                                     struct error *err) {
    double different = 0, resumed = 0, mm = 0;
    enum result result = replay_side_by_side(path, scene, 2, sums, err);
    if (result == RESULT_OK)
        result = replay_side_by_side(path, scene, 4, sums, err);
    if (result == RESULT_OK)
        result = bench_trace_unoptimized(path, case_dir, &different, err);
    if (result == RESULT_OK)
        result = bench_trace_other_cpu(path, case_dir, &mm, err);
    if (result == RESULT_OK)
        result = bench_trace_resume(path, scene, quick ? 2 : 10, &resumed, err);
    sums->differences += different;
    sums->resume_differences += resumed;
    sums->other_cpu_mm = fmax(sums->other_cpu_mm, mm);
    return result;
}

// ---- a session of the bench's own ----

struct recording {
    struct trace_writer *writer;
    struct samples append_ns;
    uint64_t missing;
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

static enum result record(const struct played *played, const struct session_settings *settings,
                          const char *path, struct recording *r, struct error *err) {
    struct trace_header header = {
        .case_hash = scene_case(played->scene)->hash,
        .settings = *settings,
        .optic = view_optic_usual(),
    };
    trace_header_set_machine(&header);
    enum result result = trace_writer_create(path, &header, NULL, NULL, &r->writer, err);
    if (result != RESULT_OK)
        return result;
    played_run(played, settings, played->motion.row_count, append, r);
    r->missing += trace_writer_status(r->writer).missing;
    trace_writer_destroy(&r->writer);
    return RESULT_OK;
}

static void report_appending(struct recording *r, struct report *report) {
    report_figure(report, 1e9 / samples_mean(&r->append_ns), "records/s", "append/rate");
    report_figure(report, samples_quantile(&r->append_ns, 0.5), "ns", "append/p50");
    report_figure(report, samples_quantile(&r->append_ns, 0.99), "ns", "append/p99");
    report_figure(report, samples_max(&r->append_ns), "ns", "append/max");
    report_figure(report, (double)r->missing, "steps", "append/missing");
    samples_fini(&r->append_ns);
}

// Sessions with cuts, in turn with each field and each kind of avatar.
static const char *const recipes[] = {"arthrosis",         "tear-radial",    "torn-mcl",
                                      "healthy",           "tear-flap",      "tear-horizontal",
                                      "torn-acl",          "tear-arthrosis", "tear-bucket-handle",
                                      "arthrosis-torn-mcl"};
#define SESSIONS (sizeof recipes / sizeof *recipes)
#define QUICK_SESSIONS 3

static enum result bench_session(const char *folder, size_t index, bool quick,
                                 struct recording *recording, struct report *report,
                                 struct sums *sums, struct error *err) {
    char case_dir[128], path[128];
    struct played played;
    struct session_settings settings = session_settings_default();
    settings.field.kind = (enum field_kind)((index + 1) % FIELD_COUNT);
    settings.avatar = (enum avatar_mode)(index % AVATAR_MODE_COUNT);
    snprintf(case_dir, sizeof case_dir, "%s/case", folder);
    snprintf(path, sizeof path, "%s/session.trace", folder);
    enum result result = played_init(CASES, recipes[index], case_dir, &played, err);
    if (result != RESULT_OK)
        return result;
    result = record(&played, &settings, path, recording, err);
    if (result == RESULT_OK)
        result = replay_on(path, played.scene, recipes[index], report, sums, err);
    if (result == RESULT_OK)
        result = replay_everywhere(path, played.scene, case_dir, quick, sums, err);
    if (result == RESULT_OK && index == 0)
        result = bench_export(path, played.scene, report, err);
    played_fini(&played);
    unlink(path);
    folder_remove(case_dir);
    return result;
}

static enum result bench_own_sessions(const char *folder, bool quick, struct report *report,
                                      struct sums *sums, struct error *err) {
    struct recording recording = {0};
    enum result result = RESULT_OK;
    for (size_t i = 0; i < (quick ? QUICK_SESSIONS : SESSIONS) && result == RESULT_OK; i++)
        result = bench_session(folder, i, quick, &recording, report, sums, err);
    if (result != RESULT_OK)
        return result;
    report_appending(&recording, report);
    report_mark(report, "replay_other_cpu_mm", sums->other_cpu_mm, "mm", 1e-6, BETTER_LOW);
    report_mark(report, "resume_state_differences", sums->resume_differences, "steps", 0,
                BETTER_LOW);
    return bench_trace_load(folder, quick, report, err);
}

// ---- a trace that is there ----

static enum result bench_file(const char *path, struct report *report, struct sums *sums,
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
        result = replay_on(path, scene, path, report, sums, err);
    scene_destroy(&scene);
    return result;
}

enum result bench_trace(const struct bench_options *options, struct report *report,
                        struct error *err) {
    struct sums sums = {.slowest = INFINITY};
    enum result result = RESULT_OK;
    char folder[FOLDER_MAX];
    for (int i = 0; result == RESULT_OK && i < options->input_count; i++)
        result = bench_file(options->inputs[i], report, &sums, err);
    if (!options->input_count) {
        folder_make(folder);
        result = bench_own_sessions(folder, options->quick, report, &sums, err);
        folder_remove(folder);
        if (result == RESULT_OK)
            result = bench_metrics(options, report, err);
    }
    if (result != RESULT_OK)
        return result;
    report_mark(report, "replay_differences", sums.differences, "steps", 0, BETTER_LOW);
    report_mark(report, "replay_over_realtime", sums.slowest, "times", 10, BETTER_HIGH);
    return RESULT_OK;
}
