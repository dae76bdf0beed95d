#include "runtime/stepping.h"

#include "base/check.h"
#include "base/clock.h"
#include "runtime/attempts.h"
#include "runtime/capture.h"
#include "runtime/cut_worker.h"
#include "runtime/looks.h"
#include "runtime/reply.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define METRICS_NS (NS_PER_S / 4)

// ---- what others learn --------------------------------------------------------------------------

void step_tell(struct worker *worker, const struct station_runtime *station, const char *text) {
    if (!station->connection.connected || !station->connection.clock_known || !station->session)
        return;
    arthron_Control message = {.which_message = arthron_Control_session_change_tag};
    reply_session(station->state, scene_case(station->session->scene),
                  &message.message.session_change);
    snprintf(message.message.session_change.text, sizeof message.message.session_change.text, "%s",
             text);
    control_send(*worker->runtime->config.control, station->connection.peer, &message);
}

void step_announce(struct worker *worker, const struct station_runtime *station) {
    step_tell(worker, station, "");
}

static void change_state(struct worker *worker, struct station_runtime *station,
                         enum session_state state) {
    station->state = state;
    worker_notify(worker, &(struct runtime_notice){.kind = NOTICE_STATE,
                                                   .station = station->index,
                                                   .session = station->session->serial,
                                                   .state = state});
    step_announce(worker, station);
}

static void publish_snapshot(struct station_runtime *station, const struct session_output *output) {
    double warp_mm = 0;
    struct snapshot_maker *maker = &station->session->snapshots;
    snapshot_step(maker, output);
    snapshot_forces(maker, &station->session->metrics.metrics);
    const struct session_attempt *attempt = station->session->attempt;
    maker->now.attempt = station->attempt_shown.state.number;
    maker->now.attempt_ns =
        attempt ? attempt->attempt.running_ns : station->attempt_shown.state.time_ns;
    newest_put(station->snapshots, &maker->now);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        warp_mm = fmax(warp_mm, maker->now.instruments[i].warp_mm);
    int64_t warp_nm = (int64_t)(warp_mm * 1e6);
    if (warp_nm > atomic_load_explicit(&station->counts.warp_nm, memory_order_relaxed))
        atomic_store_explicit(&station->counts.warp_nm, warp_nm, memory_order_relaxed);
}

// Published now and then, and whenever the session's state changes or a cut lands.
static void publish_metrics(struct station_runtime *station, const struct session_input *input,
                            const struct session_output *output) {
    struct live_metrics *metrics = &station->session->metrics;
    bool matters = output->events & EVENT_STATE || output->landed.job;
    metrics_step(&metrics->metrics, input, output);
    if (!matters && output->time_ns - station->metrics_ns < METRICS_NS)
        return;
    newest_put(station->metrics, metrics);
    station->metrics_ns = output->time_ns;
}

static void count_events(struct station_runtime *station, uint32_t events) {
    station->events |= events;
    for (int bit = 0; bit < EVENT_COUNT; bit++)
        station->event_counts[bit] += events >> bit & 1;
}

// ---- steps --------------------------------------------------------------------------------------

bool step_is_deserted(const struct worker *worker, const struct station_runtime *station) {
    return !station->connection.connected &&
           clock_now_ns() - station->last_frame_ns > worker->runtime->config.wait_s * NS_PER_S;
}

bool step_goes_on(const struct worker *worker, const struct station_runtime *station) {
    return worker_may_serve(worker) || clock_now_ns() - station->last_frame_ns <= FRESH_NS;
}

static void retire(struct worker *worker, struct station_runtime *station, enum session_end end) {
    cut_worker_close(worker->cut_worker, station->index, station->session, end);
    station->session = NULL;
}

void step_hand_over(struct worker *worker, struct station_runtime *station) {
    struct job_result **pending = &station->session->pending;
    if (*pending)
        cut_worker_release_result(worker->cut_worker, *pending);
    *pending = NULL;
    retire(worker, station, END_HANDED_OVER);
}

static void order_job(struct worker *worker, struct station_runtime *station,
                      const struct session_output *output) {
    if (!output->job.id || !station->session || station->ending)
        return;
    station->job = output->job.id;
    if (output->job.kind == JOB_UNDO)
        station->undo.job = output->job.id;
    station->job_given = output->job;
    if (output->job.kind == JOB_CUT)
        atomic_fetch_add_explicit(&worker->cuts_asked, 1, memory_order_relaxed);
    cut_worker_run(worker->cut_worker, station->index, station->session->serial,
                   &station->job_given);
}

void step_input(struct worker *worker, struct station_runtime *station, struct session_input *input,
                struct session_output *output) {
    if (input->time_ns < station->last_step_ns)
        input->time_ns = station->last_step_ns;
    station->last_step_ns = input->time_ns;
    looks_by(worker->looks, worker_place(worker->runtime, station->index),
             input->time_ns - station->session->ahead_ns + EMPTY_STEP_NS);
    progress_note(&worker->progress, "compute a step", station->index);
    int64_t begun_ns = clock_now_ns();
    session_step(station->session->session, input, output);
    latency_add(&worker->steps, clock_now_ns() - begun_ns);
    progress_note(&worker->progress, "record a step", station->index);
    trace_append(station->session->trace, input, output);
    uint64_t end = trace_position(station->session->trace);
    struct trace_status recorded = trace_writer_status(station->session->trace);
    atomic_store_explicit(&station->counts.steps, recorded.records, memory_order_relaxed);
    fair_share_record(&station->share, recorded.bytes);
    attempts_step(worker, station, input, output);
    publish_metrics(station, input, output);
    publish_snapshot(station, output);
    count_events(station, output->events);
    if (output->events & EVENT_STATE)
        change_state(worker, station, output->state);
    capture_step(worker, station, output, end);
    order_job(worker, station, output);
    if (output->state == SESSION_CLOSED)
        retire(worker, station, step_is_deserted(worker, station) ? END_DESERTED : END_CLOSED);
}

int64_t step_now_ns(const struct station_runtime *station) {
    return clock_now_ns() + station->session->ahead_ns;
}

void step_without_frame(struct worker *worker, struct station_runtime *station,
                        enum input_kind kind) {
    struct session_input input = {.kind = kind, .time_ns = step_now_ns(station)};
    struct session_output output;
    step_input(worker, station, &input, &output);
}

bool step_end(struct worker *worker, struct station_runtime *station) {
    station->ending = true;
    if (station->session->pending)
        step_land_pending(worker, station);
    if (!station->job)
        step_without_frame(worker, station, INPUT_STOP);
    return !station->job;
}

// ---- results of jobs ----------------------------------------------------------------------------

static void notify_undone(struct worker *worker, const struct station_runtime *station,
                          uint64_t session, const struct job_result *result) {
    struct runtime_notice notice = {.kind = NOTICE_UNDONE,
                                    .station = station->index,
                                    .session = session,
                                    .ticket = station->undo.ticket};
    notice.undone.outcome = result->outcome;
    notice.undone.cuts = result->cuts_back;
    notice.undone.volume_mm3 = result->mm3_back;
    notice.undone.more = result->more;
    worker_notify(worker, &notice);
}

bool step_begin_undo(struct station_runtime *station, uint64_t ticket) {
    if (station->undo.asked)
        return false;
    station->undo.asked = true;
    station->undo.ticket = ticket;
    station->undo.job = 0;
    return true;
}

void step_void_undo(struct worker *worker, struct station_runtime *station) {
    if (station->undo.asked)
        notify_undone(worker, station, station->session->serial,
                      &(struct job_result){.outcome = JOB_NOTHING});
    station->undo.asked = false;
}

// An undo that a reset has made void may have a job on its way still.
static void land(struct worker *worker, struct station_runtime *station,
                 struct job_result *result) {
    uint64_t session = station->session->serial;
    bool answers = station->undo.asked && station->undo.job == result->job;
    station->job = 0;
    if (result->kind == JOB_CUT)
        atomic_fetch_add_explicit(&worker->cuts_landed[result->outcome], 1, memory_order_relaxed);
    struct session_input input = {
        .kind = INPUT_JOB, .time_ns = step_now_ns(station), .job = result->job, .result = result};
    struct session_output output;
    step_input(worker, station, &input, &output);
    if (!answers)
        return;
    station->undo.asked = result->more;
    notify_undone(worker, station, session, result);
}

// A session that has ended since takes its results with it, and one that does not go on keeps its
// result. The cut worker releases them.
void step_results(struct worker *worker) {
    int index;
    uint64_t session;
    struct job_result *result;
    while (cut_worker_take(worker->cut_worker, &index, &session, &result)) {
        struct station_runtime *station = &worker->runtime->stations[index];
        bool lives = station->session && station->session->serial == session;
        if (lives && !step_goes_on(worker, station)) {
            station->session->pending = result;
            continue;
        }
        if (lives)
            land(worker, station, result);
        cut_worker_release_result(worker->cut_worker, result);
    }
}

void step_land_pending(struct worker *worker, struct station_runtime *station) {
    struct job_result *result = station->session->pending;
    station->session->pending = NULL;
    land(worker, station, result);
    cut_worker_release_result(worker->cut_worker, result);
}
