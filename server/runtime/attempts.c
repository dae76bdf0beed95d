#include "runtime/attempts.h"

#include "base/check.h"
#include "runtime/attempt_state.h"
#include "runtime/stepping.h"

// ---- what others learn --------------------------------------------------------------------------

void attempts_announce(struct worker *worker, const struct station_runtime *station) {
    if (!station->connection.connected || !station->connection.clock_known || !station->session)
        return;
    arthron_Control message = {.which_message = arthron_Control_attempt_tag};
    message.message.attempt = station->attempt_shown.state;
    attempt_state_withhold(&message.message.attempt);
    control_send(*worker->runtime->config.control, station->connection.peer, &message);
}

static void tell_attempt(struct worker *worker, struct station_runtime *station) {
    struct live_attempt *shown = &station->attempt_shown;
    shown->session = station->session->serial;
    shown->news++;
    attempt_state(station->session->attempt, &shown->state);
    newest_put(station->attempts, shown);
    attempts_announce(worker, station);
}

static void give_back(struct worker *worker, const struct station_runtime *station,
                      struct session_attempt *attempt) {
    worker_notify(worker, &(struct runtime_notice){.kind = NOTICE_ATTEMPT,
                                                   .station = station->index,
                                                   .attempt = attempt});
}

// ---- begin and end ------------------------------------------------------------------------------

// False where the trace has no room now: then the next step tries again, unless it was the last.
static bool end(struct worker *worker, struct station_runtime *station, bool last) {
    struct session_attempt *attempt = station->session->attempt;
    struct trace_outcome outcome;
    attempt_outcome(attempt, &outcome);
    if (!trace_append_ended(station->session->trace, &outcome) && !last)
        return false;
    tell_attempt(worker, station);
    station->session->attempt = NULL;
    give_back(worker, station, attempt);
    return true;
}

// Of an attempt that this server cannot judge: its trace takes no other one before.
static bool end_lost(struct session_runtime *session) {
    struct trace_outcome left = {
        .number = session->attempt_lost, .end = ATTEMPT_STOPPED, .verdict = VERDICT_NOT_YET};
    if (session->attempt_lost && trace_append_ended(session->trace, &left))
        session->attempt_lost = 0;
    return !session->attempt_lost;
}

void attempts_begin(struct worker *worker, struct station_runtime *station) {
    struct session_attempt *attempt = station->session->attempt;
    station->attempt_shown = (struct live_attempt){.session = station->session->serial,
                                                   .news = station->attempt_shown.news + 1};
    newest_put(station->attempts, &station->attempt_shown);
    end_lost(station->session);
    if (!attempt) {
        attempts_announce(worker, station);
        return;
    }
    tell_attempt(worker, station);
    if (attempt->attempt.end != ATTEMPT_RUNS) // the server was killed before it could say so
        end(worker, station, false);
}

// What was done before it is no part of it: the tissue is whole, and loose bodies lie where they
// lay first. One step is taken in any case, so that its begin has the time of a step, also after a
// kill.
static void prepare(struct worker *worker, struct station_runtime *station) {
    bool is_paused = station->state == SESSION_PAUSED;
    bool is_changed = session_is_changed(station->session->session);
    if (is_changed)
        step_void_undo(worker, station);
    step_without_frame(worker, station, is_changed ? INPUT_RESET : INPUT_EMPTY);
    if (is_changed && is_paused)
        step_without_frame(worker, station, INPUT_PAUSE);
}

static bool begin_attempt(struct worker *worker, struct station_runtime *station,
                          struct session_attempt *attempt) {
    struct session_runtime *session = station->session;
    struct trace_attempt begun;
    if (!worker_may_serve(worker) || !session || session->serial != attempt->session ||
        session->attempt || station->ending || session->attempts == TRACE_ATTEMPTS_MAX ||
        !trace_takes_attempts(session->trace) || !end_lost(session))
        return false;
    prepare(worker, station);
    attempt->number = session->attempts + 1;
    attempt->begun_ns = station->last_step_ns - session->snapshots.start_ns;
    attempt_init(&attempt->attempt);
    station->marking.done.is_down = false; // who holds the pedal still has not done this one
    attempt_begun(attempt, &begun);
    if (!trace_append_begun(session->trace, &begun)) {
        attempt->number = 0; // nobody hears of it
        return false;
    }
    session->attempts++;
    session->attempt = attempt;
    tell_attempt(worker, station);
    return true;
}

bool attempts_take(struct worker *worker, struct station_runtime *station,
                   struct session_attempt *attempt) {
    bool taken = begin_attempt(worker, station, attempt);
    if (!taken)
        give_back(worker, station, attempt);
    return taken;
}

bool attempts_leave(struct worker *worker, struct station_runtime *station, bool by_trainee) {
    struct session_attempt *attempt = station->session ? station->session->attempt : NULL;
    if (!attempt || attempt->attempt.end != ATTEMPT_RUNS)
        return false;
    attempt_leave(&attempt->attempt, by_trainee);
    bool has_ended = end(worker, station, false);
    if (!has_ended) // the steps that follow would belong to it here, and in its trace they do
        attempt->attempt.end = ATTEMPT_RUNS;
    return has_ended;
}

bool attempts_leave_practice(struct worker *worker, struct station_runtime *station) {
    const struct session_attempt *attempt = station->session->attempt;
    return !attempt || attempt->purpose != ATTEMPT_PRACTICE ||
           attempts_leave(worker, station, true);
}

// ---- steps --------------------------------------------------------------------------------------

void attempts_step(struct worker *worker, struct station_runtime *station,
                   const struct session_input *input, const struct session_output *output) {
    struct session_attempt *attempt = station->session->attempt;
    if (!attempt)
        return;
    bool is_first = !attempt->attempt.first_step;
    struct attempt_news news =
        attempt_take(&attempt->attempt, shared_site_site(attempt->site), input->kind, output);
    if (attempt->attempt.end != ATTEMPT_RUNS)
        end(worker, station, output->state == SESSION_CLOSED);
    else if (news.goals_met || news.errors || is_first)
        tell_attempt(worker, station);
}
