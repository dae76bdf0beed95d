#include "sessions/restore.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/kept_session.h"
#include "sessions/attempts.h"
#include "trace/part.h"
#include "trace/player.h"
#include "trace/rerun.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int scene_of(const struct sessions *s, uint64_t case_hash) {
    for (int i = 0; i < s->config.case_count; i++)
        if (scene_case(s->scenes[i])->hash == case_hash &&
            grades_allow(s->grades, i, NULL) == RESULT_OK)
            return i;
    return -1;
}

// What at_s leaves out.
static bool is_behind(const struct restored *a, const struct trace_record *record, double at_s) {
    if (!record_is_input(record))
        return false;
    int64_t since_ns = record->input.time_ns - a->header.start_ns;
    return record->input.kind == INPUT_STOP || (double)since_ns / NS_PER_S > at_s;
}

static bool is_later_part(const struct restored *a) {
    return a->header.part > 1;
}

// Of a step before the trace's own, no more is known than what its record says.
static void judge(struct restored *a, const struct trace_record *record,
                  const struct session_output *output) {
    if (!a->attempt)
        return;
    if (record->type == TRACE_STEP)
        attempt_take(&a->attempt->attempt, shared_site_site(a->attempt->site), record->input.kind,
                     output);
    else
        attempt_pass(&a->attempt->attempt, record->input.kind, record->input.time_ns,
                     &record->output.landed);
}

// One that needs not be run: what it gave is recorded, and an attempt is judged by that.
static void take_kept_step(struct restored *a, const struct trace_record *record) {
    judge(a, record, &record->output);
}

static enum result check_step(const char *path, const struct trace_record *record,
                              const struct session_output *output, struct error *err) {
    if (record->type == TRACE_STEP && record->output.hash != output->hash)
        return fail(err, RESULT_REFUSED, "%s: step %llu does not reproduce its recorded hash", path,
                    (unsigned long long)output->step);
    if (record->type == TRACE_TAKEN && !rerun_lands_as_recorded(record, output))
        return fail(err, RESULT_REFUSED,
                    "%s: job %llu of the server before does not land here as it did there", path,
                    (unsigned long long)record->output.job.id);
    return RESULT_OK;
}

static void measure(struct restored *a, const struct trace_record *record,
                    const struct session_output *output) {
    if (record->type == TRACE_STEP)
        metrics_step(&a->metrics, &record->input, output);
    else if (is_later_part(a))
        metrics_pass(&a->metrics, record->input.kind, &record->output.landed,
                     record->output.job.kind == JOB_UNDO);
}

static enum result take_step(struct restored *a, const char *path, struct rerun *rerun,
                             const struct trace_record *record, struct error *err) {
    struct session_output output;
    rerun_step(rerun, record, &output);
    if (check_step(path, record, &output, err) != RESULT_OK)
        return RESULT_REFUSED;
    measure(a, record, &output);
    snapshot_step(&a->snapshots, &output);
    judge(a, record, &output);
    a->state = output.state;
    return RESULT_OK;
}

// The runs of a station's program follow one another.
static void take_marker(struct restored *a, const struct marker *marker) {
    marker_list_put(&a->markers, marker);
    a->marked = *marker;
}

// What the steps of the server before made of it.
static enum result take_kept_attempt(struct restored *a, struct error *err) {
    struct session_attempt *attempt = a->attempt;
    if (!kept_attempt_fits(&a->kept, shared_site_site(attempt->site))) {
        attempts_free(&a->attempt);
        return fail(err, RESULT_REFUSED, "attempt %u is not kept as its task is", a->kept.number);
    }
    attempt->begun_ns = a->kept.begun_ns;
    attempt->attempt = a->kept.attempt;
    return RESULT_OK;
}

// A copy begins without: an attempt belongs to the session in which it began. The session goes on
// without one whose task this server refuses, or whose end behind the state is lost.
static void take_begun(const struct sessions *s, struct restored *a, const char *path,
                       const struct trace_attempt *begun) {
    struct error err;
    a->attempts = begun->number;
    attempts_free(&a->attempt); // its end was lost, and the reader would have said so
    bool is_kept = begun->number == a->kept.number;
    a->attempt_lost = begun->number <= a->kept.begun && !is_kept ? begun->number : 0;
    if (a->attempt_lost)
        return;
    enum result result =
        attempts_restore(s, a->scene, &a->header, begun, a->place.time_ns, &a->attempt, &err);
    if (result == RESULT_OK && is_kept)
        result = take_kept_attempt(a, &err);
    if (result == RESULT_OK)
        return;
    a->attempt_lost = begun->number;
    log_error("sessions", "%s: it goes on without this attempt: %s", path, err.text);
}

// As it was left by a command, which is no step. One that was judged otherwise then is left to its
// trace.
static void take_ended(struct restored *a, const struct trace_outcome *ended) {
    struct session_attempt *attempt = a->attempt;
    a->attempt = NULL;
    a->attempt_lost = 0;
    if (!attempt)
        return;
    attempt_end_as(&attempt->attempt, ended->end);
    if (attempt->attempt.end != ended->end) {
        attempts_free(&attempt);
        return;
    }
    attempt->next = a->ended;
    a->ended = attempt;
}

struct resume_run {
    const struct sessions *sessions;
    struct restored *restored;
    struct trace_reader *reader;
    struct rerun *rerun; // NULL before the state of a later part
    uint64_t kept;       // what is before it in the file needs not be run
    const char *path;
    const double *at_s;
    bool reached; // at_s
    enum result result;
    struct error *err;
};

// ---- from a state -------------------------------------------------------------------------------

static void take_kept(struct restored *a, const struct kept_session *kept, uint64_t step) {
    a->metrics = kept->metrics;
    a->snapshots = kept->snapshots;
    a->state = kept->snapshots.now.state;
    a->kept_step = step;
}

static enum result begin_kept(struct restored *a, const struct scene *scene,
                              struct trace_reader *reader, const struct trace_state *state,
                              struct rerun **out_rerun, struct error *err) {
    struct kept_session kept;
    enum result result = trace_reader_skim(reader, &state->place, state->output_hash, err);
    if (result == RESULT_OK)
        result = kept_session_read(state, scene, &a->header, &kept, err);
    if (result != RESULT_OK)
        return result;
    *out_rerun = rerun_go_on(kept.session, kept.operation, &kept.asked);
    take_kept(a, &kept, state->place.step);
    return RESULT_OK;
}

// The session of the server before, without its poses since.
static enum result take_over(struct resume_run *r, const struct trace_state *state) {
    struct restored *a = r->restored;
    struct kept_session kept;
    const struct scene *scene = r->sessions->scenes[a->scene];
    enum result result = kept_session_read(state, scene, &a->header, &kept, r->err);
    if (result != RESULT_OK)
        return fail_in(r->err, result == RESULT_FORMAT ? RESULT_REFUSED : result, "%s: ", r->path);
    if (!state->is_own)
        log_warning("sessions", "%s: it begins with a state that another program or machine kept",
                    r->path);
    r->rerun = rerun_go_on_elsewhere(kept.session, kept.operation, &kept.asked);
    take_kept(a, &kept, state->place.step);
    metrics_interrupt(&a->metrics);
    return RESULT_OK;
}

static enum result take_state(struct resume_run *r, const struct trace_state *state) {
    if (!state) // it has more parts
        return RESULT_OK;
    enum result result = kept_session_attempt(state, &r->restored->kept, r->err);
    if (result != RESULT_OK)
        return fail_in(r->err, result == RESULT_FORMAT ? RESULT_REFUSED : result, "%s: ", r->path);
    return r->rerun ? RESULT_OK : take_over(r, state);
}

// ---- all of it ----------------------------------------------------------------------------------

static void keep_lasting(struct lasting_records *lasting, const struct trace_record *record,
                         int rules) {
    if (lasting->room - lasting->size < TRACE_PACKED_MAX) {
        lasting->room = 2 * lasting->room + 2 * TRACE_PACKED_MAX;
        lasting->bytes = alloc_resize(lasting->bytes, lasting->room, 1);
    }
    lasting->size += trace_record_pack(record, rules, lasting->bytes + lasting->size);
}

static bool on_restored_record(void *user, const struct trace_record *record) {
    struct resume_run *r = user;
    struct restored *a = r->restored;
    bool is_kept = record->offset < r->kept;
    if (trace_journal_outlasts_state(record->type))
        keep_lasting(&a->lasting, record, a->header.settings.rules);
    if (sessions_are_ending(r->sessions))
        r->result = fail(r->err, RESULT_TIMEOUT, "%s: the server ends", r->path);
    else if (r->at_s && is_behind(a, record, *r->at_s))
        r->reached = true;
    else if (record->type == TRACE_GAP)
        r->result = fail(r->err, RESULT_REFUSED, "%s: steps are missing in it", r->path);
    else if (record->type == TRACE_STATE)
        r->result = take_state(r, record->state);
    else if (is_kept && record_is_input(record))
        take_kept_step(a, record);
    else if (record_is_input(record))
        r->result = take_step(a, r->path, r->rerun, record, r->err);
    else if (record->type == TRACE_RESUME && !is_kept)
        metrics_interrupt(&a->metrics);
    else if (record->type == TRACE_REMARK)
        remarks_put(&a->remarks, &record->remark);
    else if (record->type == TRACE_MARKER)
        take_marker(a, &record->marker);
    else if (record->type == TRACE_BEGUN && !r->at_s)
        take_begun(r->sessions, a, r->path, &record->begun);
    else if (record->type == TRACE_ENDED)
        take_ended(a, &record->ended);
    if (r->result != RESULT_OK || r->reached)
        return false;
    a->place = trace_reader_place(r->reader);
    return true;
}

// Where no whole record lies behind the state, the session goes on from the state itself.
static enum result place_at_state(struct resume_run *r) {
    struct trace_place end = trace_reader_place(r->reader);
    if (r->restored->place.offset >= r->kept)
        return RESULT_MISSING;
    if (end.offset != r->kept)
        return fail(r->err, RESULT_CORRUPT, "%s: it ends before its state", r->path);
    r->restored->place = end;
    return RESULT_MISSING;
}

// RESULT_MISSING at the end of a trace that was not closed: as it should be.
static enum result run_restore(struct resume_run *r) {
    struct trace_player player = {.user = r, .record = on_restored_record};
    enum result end = trace_play(r->reader, &player, r->err);
    if (trace_ends_torn(r->reader) || end == RESULT_OK)
        end = RESULT_MISSING;
    if (r->result != RESULT_OK)
        return r->result;
    if (end == RESULT_MISSING && !r->rerun)
        return fail(r->err, RESULT_REFUSED, "%s: it ends within the state that it begins with",
                    r->path);
    return end == RESULT_MISSING ? place_at_state(r) : end;
}

// A copy is of a time that there was.
static bool is_beyond(const struct resume_run *r, enum result result) {
    bool ended = result == RESULT_MISSING || result == RESULT_CLOSED;
    return ended && r->at_s && isfinite(*r->at_s) && !r->reached;
}

static enum result refuse_beyond(const struct resume_run *r) {
    const struct restored *a = r->restored;
    return fail(r->err, RESULT_INVALID, "%s: its session ends after %.2f s", r->path,
                (double)(a->place.time_ns - a->header.start_ns) / NS_PER_S);
}

static void make_session(const struct sessions *s, struct restored *a, struct rerun **rerun) {
    struct open_session *session = alloc(1, sizeof *session);
    struct session_runtime *runtime = &session->runtime;
    runtime->scene = s->scenes[a->scene];
    runtime->state = a->state;
    runtime->last_ns = a->place.time_ns;
    runtime->marked = a->marked;
    runtime->attempts = a->attempts;
    runtime->attempt_lost = a->attempt_lost;
    runtime->attempt = a->attempt;
    a->attempt = NULL;
    rerun_release(rerun, &runtime->session, &runtime->operation, &runtime->pending, &a->asked);
    a->session = session;
}

static enum result read_to_end(struct trace_reader *reader, struct error *err) {
    return trace_play(reader, &(struct trace_player){0}, err);
}

// A session that was closed needs no case here, unless it is to go on all the same.
static enum result refuse_restore(const struct sessions *s, const struct restored *a, const char *path,
                          const double *at_s, struct trace_reader *reader, struct error *err) {
    enum result end = at_s ? RESULT_OK : read_to_end(reader, err);
    if (end == RESULT_CLOSED || end == RESULT_IO)
        return end;
    if (a->header.version < TRACE_OLDEST_RESUMED)
        return fail(err, RESULT_REFUSED, "%s: it is of version %d", path, a->header.version);
    int index = sessions_find_case(&s->config, a->header.case_name);
    struct error why;
    if (index >= 0 && grades_are_broken(s->grades, index, &why))
        return fail(err, RESULT_IO, "%s: its case cannot be read: %s", path, why.text);
    return fail(err, RESULT_REFUSED, "%s: this server has not its case", path);
}

static enum result begin_rerun(struct restored *a, const struct scene *scene,
                               struct trace_reader *reader, const struct trace_state *state,
                               struct rerun **out_rerun, struct error *err) {
    *out_rerun = NULL;
    if (state)
        return begin_kept(a, scene, reader, state, out_rerun, err);
    if (is_later_part(a))
        return RESULT_OK;
    metrics_init(&a->metrics, &a->header.settings.instruments, a->header.optic);
    snapshot_begin(&a->snapshots, 0, a->header.start_ns);
    *out_rerun = rerun_create(scene, &a->header.settings);
    return RESULT_OK;
}

// state: NULL for all of the trace.
static enum result run_trace(const struct sessions *s, const char *path, const double *at_s,
                             const struct trace_state *state, struct restored *out,
                             struct error *err) {
    struct trace_reader *reader;
    memset(out, 0, sizeof *out);
    enum result result = trace_reader_create(path, &reader, err);
    if (result != RESULT_OK)
        return result;
    out->header = *trace_reader_header(reader);
    out->scene = scene_of(s, out->header.case_hash);
    if (out->scene < 0 || out->header.version < TRACE_OLDEST_RESUMED) {
        result = refuse_restore(s, out, path, at_s, reader, err);
        trace_reader_destroy(&reader);
        return result;
    }
    if (at_s && is_later_part(out)) {
        trace_reader_destroy(&reader);
        return fail(err, RESULT_REFUSED, "%s: part %u of a session cannot be copied", path,
                    out->header.part);
    }
    struct rerun *rerun;
    out->place = trace_reader_place(reader);
    trace_reader_bind(reader, s->scenes[out->scene]);
    result = begin_rerun(out, s->scenes[out->scene], reader, state, &rerun, err);
    uint64_t kept = state ? state->place.offset : 0;
    struct resume_run running = {s, out, reader, rerun, kept, path, at_s, false, RESULT_OK, err};
    if (result == RESULT_OK)
        result = run_restore(&running);
    if (is_beyond(&running, result))
        result = refuse_beyond(&running);
    if (result == RESULT_MISSING || (at_s && result == RESULT_CLOSED))
        make_session(s, out, &running.rerun);
    rerun_destroy(&running.rerun);
    trace_reader_destroy(&reader);
    return result;
}

static bool find_state(const char *path, struct trace_state *out) {
    struct error why;
    enum result result = trace_state_read(path, out, &why);
    if (result != RESULT_OK && result != RESULT_MISSING)
        log_warning("sessions", "%s: all of it is run again: %s", path, why.text);
    return result == RESULT_OK;
}

static bool is_over(enum result result) {
    return result == RESULT_MISSING || result == RESULT_CLOSED || result == RESULT_TIMEOUT;
}

// A copy is of any time, so that its trace is run from the beginning.
enum result restore_run(const struct sessions *s, const char *path, const double *at_s,
                        struct restored *out, struct error *err) {
    struct trace_state state;
    if (at_s || !find_state(path, &state))
        return run_trace(s, path, at_s, NULL, out, err);
    enum result result = run_trace(s, path, at_s, &state, out, err);
    free(state.content);
    if (is_over(result))
        return result;
    log_warning("sessions", "%s: its state does not fit, so all of it is run again: %s", path,
                err->text);
    restore_fini(out);
    return run_trace(s, path, at_s, NULL, out, err);
}

void restore_fini(struct restored *a) {
    remarks_fini(&a->remarks);
    marker_list_fini(&a->markers);
    attempts_free(&a->attempt);
    free(a->lasting.bytes);
    a->lasting = (struct lasting_records){0};
    while (a->ended) {
        struct session_attempt *next = a->ended->next;
        attempts_free(&a->ended);
        a->ended = next;
    }
    if (!a->session)
        return;
    attempts_free(&a->session->runtime.attempt);
    session_destroy(&a->session->runtime.session);
    operation_destroy(&a->session->runtime.operation);
    job_result_destroy(&a->session->runtime.pending);
    free(a->session);
    a->session = NULL;
}
