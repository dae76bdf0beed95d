#include "export/landings.h"

#include "base/check.h"
#include "trace/player.h"
#include "trace/rerun.h"

// Jobs are run as they are asked for; the last one's result waits here until it lands.
struct landing_run {
    const struct landing_watcher *watcher;
    struct operation *operation;
    struct job_result *pending;
    enum job_kind kind;
    const struct scene *scene;
    double from_s;
    struct rerun *rerun; // of the inputs that a piece begins with
    enum result result;
    struct error *err;
};

static void land(struct landing_run *g, const struct session_output *output, double seconds,
                 bool wanted) {
    struct landing landing = {.step = output->step,
                              .seconds = seconds,
                              .kind = g->kind,
                              .wanted = wanted,
                              .as_recorded = g->pending->hash == output->landed.hash,
                              .result = g->pending};
    g->watcher->landed(g->watcher->context, &landing, g->operation);
    g->pending = landing.result;
}

// A step's job is asked for after the one before has landed.
static void take_step(struct landing_run *g, const struct session_output *output, double seconds,
                      bool wanted) {
    const struct landed *landed = &output->landed;
    bool here = landed->job && g->pending && g->pending->job == landed->job;
    if (here && g->pending->outcome == JOB_DONE)
        land(g, output, seconds, wanted);
    if (!output->job.id)
        return;
    job_result_destroy(&g->pending);
    g->pending = operation_run(g->operation, &output->job);
    g->kind = output->job.kind;
}

static bool move_can_run(const struct blade_move *move) {
    for (int i = 0; i < 2; i++)
        if (!pose_is_valid(move->T_mesh_tip[i]) ||
            !(move->opening[i] >= 0 && move->opening[i] <= 1))
            return false;
    return true;
}

// The record's own sums say nothing of whether a job can be run.
static bool can_run(const struct scene *scene, const struct job *job) {
    if (job->tissue >= scene_tissue_count(scene))
        return false;
    for (int i = 0; i < job->move_count; i++)
        if (!move_can_run(&job->moves[i]))
            return false;
    return true;
}

static bool on_landing_step(void *user, const struct trace_record *record, double seconds) {
    struct landing_run *g = user;
    const struct job *job = &record->output.job;
    if (job->id && !can_run(g->scene, job)) {
        g->result = fail(g->err, RESULT_FORMAT, "step %llu: its job cannot be run on the case",
                         (unsigned long long)record->output.step);
        return false;
    }
    take_step(g, &record->output, seconds, seconds >= g->from_s);
    return true;
}

static bool on_past(void *user, const struct trace_record *record) {
    struct landing_run *g = user;
    struct session_output output;
    rerun_step(g->rerun, record, &output);
    return true;
}

static bool on_state(void *user, const struct trace_state *state) {
    struct landing_run *g = user;
    g->result = rerun_take_over(g->rerun, state, g->err);
    return g->result == RESULT_OK;
}

static bool stop(void *user, const struct trace_record *record) {
    (void)user, (void)record;
    return false;
}

// A piece of a record begins with inputs alone, a later part with a state: what they led to must be
// found again.
static enum result run_past(struct landing_run *g, const struct export_request *request,
                            struct error *err) {
    struct trace_reader *reader;
    struct session *session;
    struct job asked;
    struct trace_player player = {
        .user = g, .past = on_past, .taken = on_past, .state = on_state, .step = stop};
    enum result result = trace_reader_create(request->trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    if (scene_case(request->scene)->hash != trace_reader_header(reader)->case_hash)
        result = fail(err, RESULT_REFUSED, "%s was recorded with another case than %s",
                      request->trace, scene_case(request->scene)->name);
    if (result == RESULT_OK) {
        g->rerun = rerun_create(request->scene, &trace_reader_header(reader)->settings);
        struct error why; // of damage and of an early end the pass before has told
        if (trace_play(reader, &player, &why) == RESULT_IO)
            result = fail(err, RESULT_IO, "%s", why.text);
        rerun_release(&g->rerun, &session, &g->operation, &g->pending, &asked);
        session_destroy(&session);
        g->kind = asked.kind;
        result = result == RESULT_OK ? g->result : result;
    }
    trace_reader_destroy(&reader);
    return result;
}

enum result landings_run(struct walk *walk, const struct landing_watcher *watcher,
                         struct error *err) {
    const struct export_request *asked = walk->request;
    struct export_request request = *asked;
    struct contents all = {.steps = UINT64_MAX};
    struct landing_run g = {
        .watcher = watcher, .scene = asked->scene, .from_s = asked->from_s, .err = err};
    request.from_s = -INFINITY;
    walk->request = &request;
    enum result result = run_past(&g, &request, err);
    if (result == RESULT_OK) {
        watcher->start(watcher->context, g.operation);
        result = walk_run(walk, &all, on_landing_step, &g, err);
    }
    operation_destroy(&g.operation);
    job_result_destroy(&g.pending);
    walk->request = asked;
    return result == RESULT_OK ? g.result : result;
}
