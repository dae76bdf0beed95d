#include "runtime/runtime.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/cut_worker.h"
#include "runtime/keeper.h"
#include "runtime/watchdog.h"
#include "runtime/worker.h"

#include <stdio.h>
#include <stdlib.h>

// ---- begin and end ------------------------------------------------------------------------------

static void open_station(struct runtime *r, int index) {
    struct station_runtime *station = &r->stations[index];
    station->index = index;
    station->config = &r->config.stations[index];
    station->state = SESSION_CLOSED;
    station->connections = newest_create(sizeof(struct station_connection));
    station->frames = ring_create(RUNTIME_FRAMES_MAX, sizeof(struct tcp_frame));
    station->markers = ring_create(RUNTIME_MARKERS_MAX, sizeof(struct station_marker));
    station->marked = ring_create(RUNTIME_MARKERS_MAX, sizeof(struct session_marker));
    station->snapshots = newest_create(sizeof(struct step_snapshot));
    station->metrics = newest_create(sizeof(struct live_metrics));
    station->attempts = newest_create(sizeof(struct live_attempt));
    pthread_mutex_init(&station->shown_lock, NULL);
    pthread_mutex_init(&station->tissues_lock, NULL);
}

static void close_station(struct station_runtime *station) {
    newest_destroy(&station->connections);
    ring_destroy(&station->frames);
    ring_destroy(&station->markers);
    ring_destroy(&station->marked);
    newest_destroy(&station->snapshots);
    newest_destroy(&station->metrics);
    newest_destroy(&station->attempts);
    pthread_mutex_destroy(&station->shown_lock);
    pthread_mutex_destroy(&station->tissues_lock);
}

static const char *name_of(const void *user, int station) {
    return ((const struct runtime *)user)->config.stations[station].name;
}

static void watch_workers(struct runtime *r) {
    struct watched *watched = alloc(2 * (size_t)r->worker_count, sizeof *watched);
    char(*names)[32] = alloc(2 * (size_t)r->worker_count, sizeof *names);
    for (int i = 0; i < r->worker_count; i++) {
        snprintf(names[2 * i], sizeof *names, "worker %d", i);
        snprintf(names[2 * i + 1], sizeof *names, "cut worker %d", i);
        watched[2 * i] =
            (struct watched){names[2 * i], &r->workers[i].progress, WATCHDOG_WORKER_NS};
        watched[2 * i + 1] = (struct watched){
            names[2 * i + 1], cut_worker_progress(r->workers[i].cut_worker), WATCHDOG_CUTS_NS};
    }
    r->watchdog = watchdog_create(watched, 2 * r->worker_count, name_of, r);
    free(names);
    free(watched);
}

enum result runtime_create(const struct runtime_config *config, struct runtime **out_runtime,
                           struct error *err) {
    struct runtime *r = alloc(1, sizeof *r);
    enum result result = RESULT_OK;
    r->config = *config;
    r->stations = alloc((size_t)config->station_count + 1, sizeof *r->stations);
    for (int i = 0; i < config->station_count; i++)
        open_station(r, i);
    r->keeper = keeper_create(&r->config);
    r->workers = alloc((size_t)config->workers, sizeof *r->workers);
    r->worker_count = config->workers;
    for (int i = 0; i < config->workers && result == RESULT_OK; i++)
        result = worker_start(r, i, err);
    if (result == RESULT_OK)
        watch_workers(r);
    if (result != RESULT_OK) {
        runtime_stop(r, false);
        runtime_destroy(&r);
    }
    *out_runtime = r;
    return result;
}

void runtime_stop(struct runtime *r, bool hand_over) {
    if (!r)
        return;
    r->hand_over = hand_over;
    atomic_store(&r->stop, true);
    for (int i = 0; i < r->worker_count; i++)
        worker_stop(&r->workers[i]);
    keeper_destroy(&r->keeper);
    watchdog_destroy(&r->watchdog);
}

void runtime_destroy(struct runtime **runtime) {
    struct runtime *r = *runtime;
    if (!r)
        return;
    for (int i = 0; i < r->worker_count; i++)
        worker_release(&r->workers[i]);
    for (int i = 0; i < r->config.station_count; i++)
        close_station(&r->stations[i]);
    free(r->stations);
    free(r->workers);
    free(r);
    *runtime = NULL;
}

// ---- connections: the control thread ------------------------------------------------------------

static void call(struct runtime *r, int station) {
    if (atomic_exchange(&r->stations[station].called, true))
        return;
    bool pushed = ring_push(station_worker(r, station)->called, &station);
    CHECK(pushed);
}

static void tell_connection(struct runtime *r, int station) {
    newest_put(r->stations[station].connections, &r->stations[station].told);
    call(r, station);
}

static void wake(struct runtime *r, int station) {
    wake_fd(station_worker(r, station)->wake_fd);
}

void runtime_join(struct runtime *r, int station, struct control_peer peer,
                  bool confirms_in_replies) {
    struct station_connection *told = &r->stations[station].told;
    *told = (struct station_connection){.joins = told->joins + 1,
                                        .connected = true,
                                        .confirms_in_replies = confirms_in_replies,
                                        .peer = peer};
    tell_connection(r, station);
    wake(r, station);
}

void runtime_leave(struct runtime *r, int station) {
    struct station_connection *told = &r->stations[station].told;
    told->connected = told->clock_known = false;
    tell_connection(r, station);
    wake(r, station);
    cut_worker_leave(station_worker(r, station)->cut_worker, station);
}

// A better clock can wait for the worker's next turn, the first one is waited for.
void runtime_set_clock(struct runtime *r, int station, int64_t offset_ns) {
    struct station_connection *told = &r->stations[station].told;
    bool first = !told->clock_known;
    told->clock_known = true;
    told->clock_offset_ns = offset_ns;
    tell_connection(r, station);
    if (first)
        wake(r, station);
}

void runtime_confirm_path(struct runtime *r, int station, uint64_t challenge) {
    r->stations[station].told.confirms++;
    r->stations[station].told.challenge = challenge;
    tell_connection(r, station);
    wake(r, station);
}

void runtime_frame(struct runtime *r, int station, const struct frame *frame, int64_t received_ns) {
    struct station_runtime *s = &r->stations[station];
    struct tcp_frame next = {s->told.joins, received_ns, *frame};
    if (ring_push(s->frames, &next))
        call(r, station);
    else
        count_frames(&s->counts, &s->counts.frames_excess, FATE_EXCESS, 1);
    wake(r, station);
}

void runtime_marker(struct runtime *r, int station, const struct marker *marker) {
    struct station_runtime *s = &r->stations[station];
    struct station_marker next = {s->told.joins, *marker};
    if (ring_push(s->markers, &next))
        call(r, station);
    wake(r, station);
}

void runtime_slowed(struct runtime *r, int station, enum slowed what) {
    atomic_store(&r->stations[station].counts.slowed_ns[what], clock_now_ns());
}

void runtime_mesh_message(struct runtime *r, int station, struct control_peer peer,
                          const arthron_Control *message) {
    cut_worker_message(station_worker(r, station)->cut_worker, station, peer, message);
}

// ---- sessions -----------------------------------------------------------------------------------

static bool request(struct runtime *r, const struct worker_request *wanted) {
    return worker_request(station_worker(r, wanted->station), wanted);
}

// Each station has one attachment on its way at most, so there is room behind what was asked for.
void runtime_attach(struct runtime *r, int station, struct session_runtime *session) {
    bool taken = request(r, &(struct worker_request){
                                .kind = REQUEST_ATTACH, .station = station, .session = session});
    CHECK(taken);
}

bool runtime_keep(struct runtime *r, int station) {
    return request(r, &(struct worker_request){.kind = REQUEST_KEEP, .station = station});
}

bool runtime_hand_over(struct runtime *r, int station) {
    return request(r, &(struct worker_request){.kind = REQUEST_HAND_OVER, .station = station});
}

bool runtime_input(struct runtime *r, int station, enum input_kind kind, uint64_t ticket) {
    return request(r,
                   &(struct worker_request){
                       .kind = REQUEST_INPUT, .station = station, .ticket = ticket, .input = kind});
}

bool runtime_remark(struct runtime *r, int station, uint64_t session, const struct remark *remark,
                    uint64_t ticket) {
    struct worker_request wanted = {.kind = REQUEST_REMARK, .station = station, .ticket = ticket};
    wanted.of_session = session;
    wanted.remark = *remark;
    return request(r, &wanted);
}

bool runtime_attempt(struct runtime *r, int station, struct session_attempt *attempt,
                     uint64_t ticket) {
    struct worker_request wanted = {
        .kind = REQUEST_ATTEMPT, .station = station, .ticket = ticket, .attempt = attempt};
    return request(r, &wanted);
}

bool runtime_leave_attempt(struct runtime *r, int station, bool by_trainee, uint64_t ticket) {
    struct worker_request wanted = {
        .kind = REQUEST_LEAVE, .station = station, .ticket = ticket, .by_trainee = by_trainee};
    return request(r, &wanted);
}

bool runtime_mesh_request(struct runtime *r, const struct mesh_request *wanted) {
    return cut_worker_mesh_request(station_worker(r, wanted->station)->cut_worker, wanted);
}

bool runtime_next_notice(struct runtime *r, struct runtime_notice *out_notice) {
    for (int i = 0; i < r->worker_count; i++) {
        struct worker *worker = &r->workers[i];
        if (!worker->cut_worker)
            continue;
        if (ring_pop(worker->notices, out_notice) ||
            cut_worker_next_notice(worker->cut_worker, out_notice))
            return true;
    }
    return false;
}

bool runtime_next_marker(struct runtime *r, int station, struct session_marker *out_marker) {
    return ring_pop(r->stations[station].marked, out_marker);
}

// ---- what it shows ------------------------------------------------------------------------------

void runtime_snapshot(struct runtime *r, int station, struct step_snapshot *out_snapshot) {
    struct station_runtime *s = &r->stations[station];
    pthread_mutex_lock(&s->shown_lock);
    newest_take(s->snapshots, &s->snapshot);
    *out_snapshot = s->snapshot;
    pthread_mutex_unlock(&s->shown_lock);
}

void runtime_metrics(struct runtime *r, int station, struct live_metrics *out_metrics) {
    struct station_runtime *s = &r->stations[station];
    pthread_mutex_lock(&s->shown_lock);
    newest_take(s->metrics, &s->last_metrics);
    *out_metrics = s->last_metrics;
    pthread_mutex_unlock(&s->shown_lock);
}

void runtime_shown_attempt(struct runtime *r, int station, struct live_attempt *out_attempt) {
    struct station_runtime *s = &r->stations[station];
    pthread_mutex_lock(&s->shown_lock);
    newest_take(s->attempts, &s->last_attempt);
    *out_attempt = s->last_attempt;
    pthread_mutex_unlock(&s->shown_lock);
}

void runtime_tissues(struct runtime *r, int station, struct tissue_report *out_report) {
    struct station_runtime *s = &r->stations[station];
    pthread_mutex_lock(&s->tissues_lock);
    *out_report = s->tissues;
    pthread_mutex_unlock(&s->tissues_lock);
}

const struct station_counts *runtime_counts(const struct runtime *r, int station) {
    return &r->stations[station].counts;
}

void runtime_count_invalid_frame(struct runtime *r, int station) {
    struct station_counts *counts = &r->stations[station].counts;
    count_frames(counts, &counts->frames_invalid, FATE_INVALID, 1);
}

double runtime_take_warp_mm(struct runtime *r, int station) {
    return (double)atomic_exchange(&r->stations[station].counts.warp_nm, 0) / 1e6;
}

int64_t runtime_take_pause_ns(struct runtime *r, int station, int64_t now_ns) {
    struct station_counts *counts = &r->stations[station].counts;
    int64_t pause_ns = atomic_exchange(&counts->pause_ns, 0);
    int64_t since_ns = now_ns - atomic_load(&counts->frame_ns);
    return pause_ns > since_ns ? pause_ns : since_ns;
}

struct socket_counts runtime_socket_counts(const struct runtime *r) {
    struct socket_counts sum = {0};
    for (int i = 0; i < r->worker_count; i++) {
        const struct worker *w = &r->workers[i];
        sum.strangers += atomic_load(&w->counts.strangers);
        sum.forged += atomic_load(&w->counts.forged);
        sum.replayed += atomic_load(&w->counts.replayed);
        sum.malformed += atomic_load(&w->counts.malformed);
        sum.too_long += atomic_load(&w->counts.too_long);
    }
    return sum;
}

static void gather(const struct worker *w, struct runtime_figures *sum) {
    latency_gather(&w->steps, &sum->steps);
    latency_gather(&w->answers, &sum->answers);
    latency_gather(&w->cuts, &sum->cuts);
    sum->cuts_asked += atomic_load(&w->cuts_asked);
    for (int i = 0; i < JOB_OUTCOME_COUNT; i++)
        sum->cuts_landed[i] += atomic_load(&w->cuts_landed[i]);
    sum->requests_waiting += ring_count(w->requests);
    sum->notices_waiting += ring_count(w->notices);
    cut_worker_waiting(w->cut_worker, &sum->jobs_waiting, &sum->mesh_requests_waiting);
}

void runtime_figures(const struct runtime *r, struct runtime_figures *out) {
    *out = (struct runtime_figures){0};
    for (int i = 0; i < r->worker_count; i++)
        gather(&r->workers[i], out);
}

int64_t runtime_looked_ns(const struct runtime *r) {
    return watchdog_looked_ns(r->watchdog);
}
