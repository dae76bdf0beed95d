// Tasks by an expert's and a novice's hands: whether they pass, whether the verdict is the same live,
// over kills and from the trace, what judging costs, and whether the noise of a tracker changes it.
#include "base/check.h"
#include "base/clock.h"
#include "bench.h"
#include "folder.h"
#include "generate/generate.h"
#include "landmarks/landmarks.h"
#include "lives/lives.h"
#include "loose.h"
#include "random.h"
#include "rehearsal/play.h"
#include "rehearsal/rehearsal.h"
#include "samples.h"
#include "step/session.h"
#include "trace/rerun.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RATE_HZ 100.0
#define NOVICES 3
#define NOISES 3
#define NOISE_MM 0.1 // root mean square, along each axis
#define KILLS 2
#define BLOCK 50 // steps that are timed together

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
    bool quick;
    char dir[FOLDER_MAX], path[FOLDER_MAX + 16]; // of the case; of the trace
    const char *recipe;                          // that the case is made of
    struct task_file file;
    struct knee_case *knee;
    struct scene *scene;
    struct site *site;
    int tasks, attempts, kills, differences, flickers;
    int experts, experts_passed, novices, novices_passed;
    double over_plain; // of the dearest task
};

// ---- the case and the task ----------------------------------------------------------------------

static enum result generate(const struct measuring *m, const char *name, struct error *err) {
    char path[512];
    struct recipe recipe;
    struct knee_case *made = NULL;
    snprintf(path, sizeof path, "%s/%s", CASES, name);
    enum result result = recipe_load(path, &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &made, err);
    if (result == RESULT_OK)
        result = landmarks_find(made, NULL, err);
    if (result == RESULT_OK)
        result = case_save(made, m->dir, err);
    case_destroy(&made);
    return result;
}

static void drop_case(struct measuring *m) {
    scene_destroy(&m->scene);
    case_destroy(&m->knee);
    m->recipe = NULL;
}

static enum result load_case(struct measuring *m, const char *recipe, struct error *err) {
    struct knee_case *second = NULL;
    if (m->recipe && !strcmp(m->recipe, recipe))
        return RESULT_OK;
    drop_case(m);
    enum result result = generate(m, recipe, err);
    if (result == RESULT_OK)
        result = case_load(m->dir, NULL, &m->knee, err);
    if (result == RESULT_OK)
        result = case_load(m->dir, NULL, &second, err);
    if (result == RESULT_OK)
        result = scene_create(&second, &m->scene, err);
    case_destroy(&second);
    if (result == RESULT_OK)
        m->recipe = recipe;
    return result;
}

static enum result load(struct measuring *m, size_t row, struct error *err) {
    char path[512];
    snprintf(path, sizeof path, "%s/tasks/%s.ini", CASES, rows[row].task);
    enum result result = task_read(path, &m->file, err);
    if (result == RESULT_OK)
        result = load_case(m, rows[row].recipe, err);
    if (result != RESULT_OK)
        return result;
    struct view_optic optic = task_optic(&m->file.task);
    return site_create(&m->file.task, m->scene, instruments_of_hands(), &optic, &m->site, err);
}

// ---- the same verdict, live, over kills and from the trace --------------------------------------

static enum result live(struct measuring *m, const struct motion *motion, struct error *err) {
    struct lives lives;
    remove(m->path);
    enum result result = lives_run(&m->file, m->scene, motion, RATE_HZ, m->quick ? 1 : KILLS, 1,
                                   m->path, &lives, err);
    if (result != RESULT_OK)
        return result;
    m->attempts++;
    m->kills += lives.kills;
    m->differences += lives.differences + (lives.verdict != lives.traced_verdict);
    if (lives.differences)
        report_figure(m->report, lives.differences, "", "%s/differences", m->file.task.name);
    return RESULT_OK;
}

// ---- a task's time in a step --------------------------------------------------------------------

// A recorded session that is run again, with the task or without.
struct half {
    bool with;
    struct trace_reader *reader;
    struct rerun *rerun;
    struct attempt attempt;
};

static enum result half_open(struct half *half, const struct measuring *m, bool with,
                             struct error *err) {
    enum result result = trace_reader_create(m->path, &half->reader, err);
    if (result != RESULT_OK)
        return result;
    half->with = with;
    trace_reader_bind(half->reader, m->scene);
    half->rerun = rerun_create(m->scene, &trace_reader_header(half->reader)->settings);
    attempt_init(&half->attempt);
    return RESULT_OK;
}

static void half_close(struct half *half) {
    if (half->rerun)
        rerun_destroy(&half->rerun);
    trace_reader_destroy(&half->reader);
}

// The time of the next steps; NAN at the trace's end. Steps that ask for a job are left out, as the
// job runs within them here.
static double run_block(struct half *half, const struct site *site) {
    struct trace_record record;
    struct session_output output;
    double s = 0;
    for (int steps = 0; steps < BLOCK;) {
        if (trace_read(half->reader, &record, NULL) != RESULT_OK)
            return NAN;
        if (record.type != TRACE_STEP)
            continue;
        int64_t begin_ns = clock_now_ns();
        rerun_step(half->rerun, &record, &output);
        if (half->with)
            attempt_take(&half->attempt, site, record.input.kind, &output);
        s += output.job.id ? 0 : 1e-9 * (double)(clock_now_ns() - begin_ns);
        steps++;
    }
    return s;
}

// Blocks of both in turns, so that whatever else the machine does slows both.
static enum result time_steps(struct measuring *m, struct error *err) {
    struct half plain = {0}, with = {0};
    struct samples ratios = {0};
    enum result result = half_open(&plain, m, false, err);
    if (result == RESULT_OK)
        result = half_open(&with, m, true, err);
    for (int i = 0; result == RESULT_OK; i++) {
        double first_s = run_block(i % 2 ? &plain : &with, m->site);
        double second_s = run_block(i % 2 ? &with : &plain, m->site);
        double ratio = i % 2 ? second_s / first_s : first_s / second_s;
        if (!isfinite(ratio))
            break;
        samples_add(&ratios, ratio);
    }
    double median = samples_quantile(&ratios, 0.5);
    if (result == RESULT_OK)
        report_figure(m->report, median, "", "%s/step over plain", m->file.task.name);
    m->over_plain = fmax(m->over_plain, median);
    samples_fini(&ratios);
    half_close(&plain);
    half_close(&with);
    return result;
}

// ---- the noise of a tracker ---------------------------------------------------------------------

static void shake(struct motion *motion, uint64_t seed) {
    struct random random = {seed};
    for (size_t row = 0; row < motion->row_count; row++)
        for (int tool = 0; tool < motion->tool_count; tool++) {
            vec3 *tip = &motion->rows[row].tools[tool].T_mockup_tip.translation;
            tip->x += NOISE_MM * random_normal(&random);
            tip->y += NOISE_MM * random_normal(&random);
            tip->z += NOISE_MM * random_normal(&random);
        }
}

// What the noise made: errors, goals that are met in one of the two alone, another verdict.
static int flickers(const struct measuring *m, const struct attempt *calm,
                    const struct attempt *shaken) {
    const struct task *task = &m->file.task;
    int count = attempt_verdict(calm, task) != attempt_verdict(shaken, task);
    for (int e = 0; e < task->error_count; e++)
        for (int tool = 0; tool < INSTRUMENT_COUNT; tool++) {
            int more = shaken->found[e][tool].count - calm->found[e][tool].count;
            count += more > 0 ? more : 0;
        }
    for (int g = 0; g < task->goal_count; g++)
        count += calm->goals[g].met != shaken->goals[g].met;
    return count;
}

static void shake_hands(struct measuring *m, const struct rehearsal *calm) {
    struct motion shaken = calm->motion;
    struct attempt attempt;
    size_t size = shaken.row_count * sizeof *shaken.rows;
    shaken.rows = alloc(shaken.row_count, sizeof *shaken.rows);
    for (uint64_t seed = 1; seed <= (m->quick ? 1 : NOISES); seed++) {
        memcpy(shaken.rows, calm->motion.rows, size);
        shake(&shaken, seed);
        play_motion(&shaken, RATE_HZ, m->scene, m->site, NULL, &attempt);
        int count = flickers(m, &calm->attempt, &attempt);
        m->flickers += count;
        if (count)
            report_figure(m->report, count, "", "%s/flickers by noise %d", m->file.task.name,
                          (int)seed);
    }
    free(shaken.rows);
}

// ---- one task -----------------------------------------------------------------------------------

static bool has_passed(const struct measuring *m, enum rehearsal_hands hands, int64_t seed,
                       const struct attempt *attempt) {
    bool passed = attempt_verdict(attempt, &m->file.task) == VERDICT_PASSED;
    report_figure(m->report, attempt_time_s(attempt), "s", "%s/%s %d/%s", m->file.task.name,
                  hands == HANDS_EXPERT ? "expert" : "novice", (int)seed,
                  passed ? "passed" : "not yet");
    return passed;
}

static enum result try_expert(struct measuring *m, struct rehearsal *expert, struct error *err) {
    enum result result =
        rehearse(&m->file.task, m->knee, m->scene, HANDS_EXPERT, 0, NULL, expert, err);
    if (result != RESULT_OK)
        return result;
    m->experts++;
    m->experts_passed += has_passed(m, HANDS_EXPERT, 0, &expert->attempt);
    shake_hands(m, expert);
    result = live(m, &expert->motion, err);
    return result == RESULT_OK ? time_steps(m, err) : result;
}

static enum result try_novice(struct measuring *m, const struct rehearsal *expert, int64_t seed,
                              struct error *err) {
    struct rehearsal novice;
    enum result result =
        rehearse_novice(&m->file.task, m->knee, m->scene, expert, seed, &novice, err);
    if (result != RESULT_OK)
        return result;
    m->novices++;
    m->novices_passed += has_passed(m, HANDS_NOVICE, seed, &novice.attempt);
    if (seed == 1 && !m->quick)
        result = live(m, &novice.motion, err);
    rehearsal_fini(&novice);
    return result;
}

// A novice's hands come of an expert's that met all goals.
static enum result measure(struct measuring *m, size_t row, struct error *err) {
    struct rehearsal expert = {0};
    enum result result = load(m, row, err);
    if (result == RESULT_OK)
        result = try_expert(m, &expert, err);
    int novices = expert.goal >= 0 ? 0 : m->quick ? 1 : NOVICES;
    for (int seed = 1; seed <= novices && result == RESULT_OK; seed++)
        result = try_novice(m, &expert, seed, err);
    rehearsal_fini(&expert);
    site_destroy(&m->site);
    m->tasks++;
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", rows[row].task);
}

static void tell(const struct measuring *m) {
    struct report *report = m->report;
    char extent[160];
    snprintf(extent, sizeof extent, "%d of %d tasks, %d novice%s and %d noise%s at each%s", m->tasks,
             (int)ROW_COUNT, m->quick ? 1 : NOVICES, m->quick ? "" : "s", m->quick ? 1 : NOISES,
             m->quick ? "" : "s", m->quick ? " (--quick)" : "");
    report_text(report, "extent", extent);
    report_mark(report, "verdict_differences", m->differences, "", 0, BETTER_LOW);
    report_mark(report, "task_step_over_plain", m->over_plain, "", 1.15, BETTER_LOW);
    report_mark(report, "expert_pass_share", (double)m->experts_passed / m->experts, "", 1,
                BETTER_HIGH);
    report_mark(report, "novice_pass_share", (double)m->novices_passed / m->novices, "", 0,
                BETTER_LOW);
    report_mark(report, "flicker_events", m->flickers, "", 0, BETTER_LOW);
    report_figure(report, m->attempts, "", "attempts compared");
    report_figure(report, m->kills, "", "kills");
}

static bool is_wanted(const struct bench_options *options, size_t row) {
    for (int i = 0; i < options->input_count; i++)
        if (!strcmp(options->inputs[i], rows[row].task))
            return true;
    return !options->input_count && (rows[row].quick || !options->quick);
}

enum result bench_tasks(const struct bench_options *options, struct report *report,
                        struct error *err) {
    struct measuring *m = alloc(1, sizeof *m);
    enum result result = RESULT_OK;
    m->report = report;
    m->quick = options->quick;
    folder_make(m->dir);
    snprintf(m->path, sizeof m->path, "%s/one.trace", m->dir);
    for (size_t i = 0; i < ROW_COUNT && result == RESULT_OK; i++)
        if (is_wanted(options, i))
            result = measure(m, i, err);
    if (result == RESULT_OK && !m->tasks)
        result = fail(err, RESULT_MISSING, "there is no such task");
    if (result == RESULT_OK)
        tell(m);
    if (result == RESULT_OK && !options->input_count)
        result = loose_measure(report, err);
    drop_case(m);
    folder_remove(m->dir);
    free(m);
    return result;
}
