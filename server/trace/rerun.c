#include "trace/rerun.h"

#include "base/check.h"
#include "base/clock.h"
#include "trace/state_session.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LAND_AFTER_NS (NS_PER_S / 2)

struct rerun {
    const struct scene *scene; // of a session from its beginning
    struct session_settings settings;
    struct session *session;
    struct operation *operation;
    struct job_result *pending; // of the last job that the session asked for, until it lands
    struct job asked;           // that job
    int64_t asked_ns;
    struct rerun_touches touches;
    void (*landed)(void *user, const struct job_result *result); // or NULL
    void *user;
};

struct rerun *rerun_create(const struct scene *scene, const struct session_settings *settings) {
    struct rerun *rerun = alloc(1, sizeof *rerun);
    rerun->scene = scene;
    rerun->settings = *settings;
    rerun->session = session_create(scene, settings);
    rerun->operation = operation_create(scene, settings->rules, &settings->instruments);
    return rerun;
}

static void run_job(struct rerun *rerun, const struct job *job) {
    job_result_destroy(&rerun->pending);
    rerun->asked = *job;
    rerun->pending = operation_run(rerun->operation, job);
}

struct rerun *rerun_go_on(struct session *session, struct operation *operation,
                          const struct job *asked) {
    struct rerun *rerun = alloc(1, sizeof *rerun);
    rerun->session = session;
    rerun->operation = operation;
    if (asked->id)
        run_job(rerun, asked);
    return rerun;
}

struct rerun *rerun_go_on_elsewhere(struct session *session, struct operation *operation,
                                    const struct job *asked) {
    session_take_over(session);
    return rerun_go_on(session, operation, asked);
}

enum result rerun_take_over(struct rerun *rerun, const struct trace_state *state,
                            struct error *err) {
    struct session *session;
    struct operation *operation;
    struct job asked;
    enum result result = state_session_read(state, rerun->scene, &rerun->settings, &session,
                                            &operation, &asked, err);
    if (result != RESULT_OK)
        return result;
    session_destroy(&rerun->session);
    operation_destroy(&rerun->operation);
    session_take_over(session);
    rerun->session = session;
    rerun->operation = operation;
    if (asked.id)
        run_job(rerun, &asked);
    return RESULT_OK;
}

void rerun_destroy(struct rerun **rerun) {
    if (!*rerun)
        return;
    session_destroy(&(*rerun)->session);
    operation_destroy(&(*rerun)->operation);
    job_result_destroy(&(*rerun)->pending);
    free(*rerun);
    *rerun = NULL;
}

void rerun_watch(struct rerun *rerun, void (*landed)(void *user, const struct job_result *result),
                 void *user) {
    rerun->landed = landed;
    rerun->user = user;
}

static void step(struct rerun *rerun, struct session_input *input, struct job_result *result,
                 struct session_output *output) {
    if (input->kind == INPUT_JOB)
        input->result = result;
    session_step(rerun->session, input, output);
    if (result) {
        CHECK(result == rerun->pending);
        if (rerun->landed)
            rerun->landed(rerun->user, result);
        job_result_destroy(&rerun->pending);
    }
    if (!output->job.id)
        return;
    run_job(rerun, &output->job);
    rerun->asked_ns = input->time_ns;
}

// A touch that cannot be taken differs, unless it is the same.
static bool take_touch(struct rerun *rerun, const struct touch_change *touch) {
    struct job_result *result = rerun->pending;
    if (!operation_allows_touch(rerun->operation, result, touch))
        return touch_hash(&result->touch) == touch_hash(touch);
    double apart_mm = operation_take_touch(rerun->operation, result, touch);
    rerun->touches.largest_mm = fmax(rerun->touches.largest_mm, apart_mm);
    return apart_mm == 0;
}

// One that the session cannot have asked for is not run, and does not land.
static void take_job(struct rerun *rerun, const struct trace_record *record) {
    const struct job *job = &record->output.job;
    if (!session_take_job(rerun->session, job))
        return;
    if (!rerun->pending || rerun->pending->job != job->id)
        run_job(rerun, job);
    if (!record->output.landed.job)
        session_void_job(rerun->session, rerun->pending->tissue);
}

void rerun_step(struct rerun *rerun, const struct trace_record *record,
                struct session_output *output) {
    struct session_input input = record->input;
    struct rerun_touches *touches = &rerun->touches;
    if (record->type == TRACE_STEP)
        session_go_on(rerun->session);
    if (record->type == TRACE_TAKEN)
        take_job(rerun, record);
    bool lands = input.kind == INPUT_JOB && record->job_done && rerun->pending &&
                 rerun->pending->job == input.job;
    bool differs = lands && record->touch && !take_touch(rerun, record->touch);
    step(rerun, &input, lands ? rerun->pending : NULL, output);
    touches->landed += lands && record->touch;
    touches->different += differs;
    if (differs && touches->different == 1) {
        touches->first_step = output->step;
        touches->first_job = input.job;
    }
}

bool rerun_lands_as_recorded(const struct trace_record *record,
                             const struct session_output *output) {
    const struct landed *a = &record->output.landed, *b = &output->landed;
    return a->job == b->job && a->outcome == b->outcome && a->tissue == b->tissue &&
           a->hash == b->hash && a->touch_hash == b->touch_hash &&
           memcmp(&a->figures, &b->figures, sizeof a->figures) == 0;
}

struct rerun_touches rerun_touches(const struct rerun *rerun) {
    return rerun->touches;
}

void rerun_step_freely(struct rerun *rerun, const struct trace_record *record,
                       struct session_output *output, struct landed *out_landed) {
    struct session_input input = record->input;
    memset(out_landed, 0, sizeof *out_landed);
    if (input.kind == INPUT_JOB && rerun->pending) {
        input.job = rerun->pending->job;
        step(rerun, &input, rerun->pending, output);
        return;
    }
    if (rerun->pending && input.time_ns - rerun->asked_ns >= LAND_AFTER_NS) {
        struct session_input landing = {
            .kind = INPUT_JOB, .time_ns = input.time_ns, .job = rerun->pending->job};
        step(rerun, &landing, rerun->pending, output);
        *out_landed = output->landed;
    }
    step(rerun, &input, NULL, output);
}

const struct operation *rerun_operation(const struct rerun *rerun) {
    return rerun->operation;
}

void rerun_release(struct rerun **rerun, struct session **out_session,
                   struct operation **out_operation, struct job_result **out_pending,
                   struct job *out_asked) {
    session_go_on((*rerun)->session);
    if (out_asked)
        *out_asked = (*rerun)->pending ? (*rerun)->asked : (struct job){0};
    *out_session = (*rerun)->session;
    *out_operation = (*rerun)->operation;
    *out_pending = (*rerun)->pending;
    free(*rerun);
    *rerun = NULL;
}
