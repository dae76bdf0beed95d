#include "base/check.h"
#include "base/clock.h"
#include "bench.h"
#include "folder.h"
#include "generate/generate.h"
#include "judging/judging.h"
#include "landmarks/landmarks.h"
#include "rehearsal/play.h"
#include "rehearsal/rehearsal.h"
#include "samples.h"
#include "step/session.h"
#include "trace/rerun.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define RATE_HZ 100.0
#define RUNS 9
#define NOVICES 3

// Each task with the case that has what it is about.
static const struct {
    const char *task, *recipe;
    bool quick;
} rows[] = {
    {"steady-camera", "healthy", true},
    {"centring", "healthy", false},
    {"turning-30", "healthy", false},
    {"turning-70", "healthy", true},
    {"telescoping", "healthy", true},
    {"line-tracing", "healthy", false},
    {"probe-in-order", "healthy", false},
    {"triangulation", "healthy", false},
    {"hands-swapped", "healthy", false},
    {"palpation", "healthy", false},
    {"valgus-stress", "healthy", true},
    {"diagnostic-examination", "healthy", false},
    {"cruciate-examination", "healthy", false},
    {"loose-bodies", "loose-bodies", false},
    {"meniscectomy-radial", "tear-radial", false},
    {"meniscectomy-flap", "tear-flap", false},
    {"meniscectomy-horizontal", "tear-horizontal", false},
    {"meniscectomy-bucket-handle", "tear-bucket-handle", false},
};
#define ROW_COUNT (sizeof rows / sizeof *rows)

struct measuring {
    struct report *report;
    char dir[FOLDER_MAX], path[FOLDER_MAX + 16]; // of the case; of the trace
    struct task_file file;
    struct knee_case *knee;
    struct scene *scene;
    struct site *site;
    struct trace_writer *writer;
    uint64_t appended;
    struct attempt judged;
    int attempts, differences, experts, experts_passed, novices, novices_passed;
    struct samples over_plain;
};

// ---- the case and the task ----------------------------------------------------------------------

static enum result load(struct measuring *m, const char *name, const char *recipe_name,
                        struct error *err) {
    char path[512];
    struct recipe recipe;
    struct knee_case *made = NULL, *second = NULL;
    snprintf(path, sizeof path, "%s/tasks/%s.ini", CASES, name);
    enum result result = task_read(path, &m->file, err);
    snprintf(path, sizeof path, "%s/%s", CASES, recipe_name);
    if (result == RESULT_OK)
        result = recipe_load(path, &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &made, err);
    if (result == RESULT_OK)
        result = landmarks_find(made, NULL, err);
    if (result == RESULT_OK)
        result = case_save(made, m->dir, err);
    case_destroy(&made);
    if (result == RESULT_OK)
        result = case_load(m->dir, NULL, &m->knee, err);
    if (result == RESULT_OK)
        result = case_load(m->dir, NULL, &second, err);
    if (result == RESULT_OK)
        result = scene_create(&second, &m->scene, err);
    case_destroy(&second);
    return result;
}

static void unload(struct measuring *m) {
    site_destroy(&m->site);
    scene_destroy(&m->scene);
    case_destroy(&m->knee);
}

// ---- the same verdict, live, from the trace and after a restart ---------------------------------

static void append(void *user, const struct session_input *input,
                   const struct session_output *output) {
    struct measuring *m = user;
    trace_append(m->writer, input, output);
    if (++m->appended % 500 == 0) // a disk cannot keep up with steps in virtual time
        nanosleep(&(struct timespec){.tv_nsec = 25 * NS_PER_MS}, NULL);
}

// Plays the motion again, and records it.
static enum result record(struct measuring *m, const struct motion *motion,
                          struct attempt *out_live, struct error *err) {
    struct trace_header header = {.case_hash = scene_case(m->scene)->hash,
                                  .settings = session_settings_default(),
                                  .optic = *site_optic(m->site),
                                  .loose_count = scene_case(m->scene)->loose_count};
    header.settings.instruments = *site_tools(m->site);
    struct trace_attempt begun = {.number = 1,
                                  .pass_time_s = m->file.task.pass_time_s,
                                  .pass_errors = (uint32_t)m->file.task.pass_errors,
                                  .size = (uint32_t)m->file.size,
                                  .text = m->file.text};
    snprintf(begun.task, sizeof begun.task, "%s", m->file.task.name);
    trace_header_set_machine(&header);
    snprintf(m->path, sizeof m->path, "%s/one.trace", m->dir);
    remove(m->path);
    enum result result = trace_writer_create(m->path, &header, NULL, &m->writer, err);
    if (result != RESULT_OK)
        return result;
    trace_append_begun(m->writer, &begun);
    struct play_watch watch = {m, append};
    play_motion(motion, RATE_HZ, m->scene, m->site, &watch, out_live);
    trace_writer_destroy(&m->writer);
    return RESULT_OK;
}

static void take(void *user, const struct judged_attempt *judged) {
    ((struct measuring *)user)->judged = judged->attempt;
}

static enum result judge(struct measuring *m, struct error *err) {
    struct trace_reader *reader = NULL;
    struct attempt_taker taker = {.user = m, .take = take};
    memset(&m->judged, 0, sizeof m->judged);
    enum result result = trace_reader_create(m->path, &reader, err);
    if (result == RESULT_OK)
        result = judge_trace(reader, m->scene, &taker, err);
    trace_reader_destroy(&reader);
    attempt_leave(&m->judged);
    return result == RESULT_CLOSED ? RESULT_OK : result;
}

// Runs the recorded inputs again in a new session, as a server does that was killed. with: NULL for
// the session alone. Returns the time that the steps took, NAN after an error.
static double run_again(struct measuring *m, struct attempt *with, struct error *err) {
    struct trace_reader *reader = NULL;
    struct trace_record record;
    struct session_output output;
    double s = 0;
    if (trace_reader_create(m->path, &reader, err) != RESULT_OK)
        return NAN;
    trace_reader_bind(reader, m->scene);
    struct rerun *rerun = rerun_create(m->scene, &trace_reader_header(reader)->settings);
    if (with)
        attempt_init(with);
    while (trace_read(reader, &record, err) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        int64_t begin_ns = clock_now_ns();
        rerun_step(rerun, &record, &output);
        if (with)
            attempt_take(with, m->site, record.input.kind, &output);
        s += 1e-9 * (double)(clock_now_ns() - begin_ns);
    }
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    if (with)
        attempt_leave(with);
    return s;
}

static enum result compare(struct measuring *m, const struct motion *motion, struct error *err) {
    struct attempt live, again;
    enum result result = record(m, motion, &live, err);
    if (result == RESULT_OK)
        result = judge(m, err);
    if (result != RESULT_OK)
        return result;
    run_again(m, &again, err);
    m->attempts++;
    m->differences += memcmp(&live, &m->judged, sizeof live) != 0;
    m->differences += memcmp(&live, &again, sizeof live) != 0;
    return RESULT_OK;
}

// ---- a task's time in a step --------------------------------------------------------------------

static void time_steps(struct measuring *m, struct error *err) {
    struct samples with = {0}, without = {0};
    struct attempt attempt;
    for (int i = 0; i < RUNS; i++) {
        samples_add(&without, run_again(m, NULL, err));
        samples_add(&with, run_again(m, &attempt, err));
    }
    samples_add(&m->over_plain, samples_quantile(&with, 0.5) / samples_quantile(&without, 0.5));
    samples_fini(&with);
    samples_fini(&without);
}

// ---- one task -----------------------------------------------------------------------------------

static enum result try_hands(struct measuring *m, enum hands hands, int64_t seed, bool *out_passed,
                             struct error *err) {
    struct rehearsal rehearsal;
    enum result result =
        rehearse(&m->file.task, m->knee, m->scene, hands, seed, NULL, &rehearsal, err);
    if (result != RESULT_OK)
        return result;
    *out_passed = attempt_verdict(&rehearsal.attempt, &m->file.task) == VERDICT_PASSED;
    report_figure(m->report, attempt_time_s(&rehearsal.attempt), "s", "%s/%s %d/%s",
                  m->file.task.name, hands == HANDS_EXPERT ? "expert" : "novice", (int)seed,
                  *out_passed ? "passed" : "not yet");
    if (seed <= 1)
        result = compare(m, &rehearsal.motion, err);
    rehearsal_fini(&rehearsal);
    return result;
}

static enum result measure(struct measuring *m, size_t row, bool quick, struct error *err) {
    struct view_optic optic = view_optic_usual();
    bool passed;
    enum result result = load(m, rows[row].task, rows[row].recipe, err);
    if (!isnan(m->file.task.optic_deg))
        optic.tilt_deg = m->file.task.optic_deg;
    if (result == RESULT_OK)
        result =
            site_create(&m->file.task, m->scene, instruments_of_hands(), &optic, &m->site, err);
    if (result == RESULT_OK)
        result = try_hands(m, HANDS_EXPERT, 0, &passed, err);
    if (result == RESULT_OK) {
        m->experts++;
        m->experts_passed += passed;
    }
    if (result == RESULT_OK && rows[row].quick)
        time_steps(m, err);
    for (int seed = 1; seed <= (quick ? 1 : NOVICES) && result == RESULT_OK; seed++) {
        result = try_hands(m, HANDS_NOVICE, seed, &passed, err);
        m->novices++;
        m->novices_passed += passed;
    }
    unload(m);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", rows[row].task);
}

enum result bench_tasks(const struct bench_options *options, struct report *report,
                        struct error *err) {
    struct measuring *m = alloc(1, sizeof *m);
    enum result result = RESULT_OK;
    m->report = report;
    folder_make(m->dir);
    for (size_t i = 0; i < ROW_COUNT && result == RESULT_OK; i++)
        if (rows[i].quick || !options->quick)
            result = measure(m, i, options->quick, err);
    report_mark(report, "verdict_differences", m->differences, "attempts", 0, BETTER_LOW);
    report_mark(report, "task_step_over_plain", samples_quantile(&m->over_plain, 0.5), "", 1.15,
                BETTER_LOW);
    report_mark(report, "expert_pass_share", (double)m->experts_passed / m->experts, "", 1,
                BETTER_HIGH);
    report_mark(report, "novice_pass_share", (double)m->novices_passed / m->novices, "", 0,
                BETTER_LOW);
    report_figure(report, m->attempts, "attempts", "compared");
    samples_fini(&m->over_plain);
    folder_remove(m->dir);
    free(m);
    return result;
}
