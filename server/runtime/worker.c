#include "runtime/worker.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/attempts.h"
#include "runtime/cut_worker.h"
#include "runtime/frames.h"
#include "runtime/keeper.h"
#include "runtime/looks.h"
#include "runtime/markers.h"
#include "runtime/session_begin.h"
#include "runtime/stepping.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#define REST_AFTER_NS NS_PER_S
#define MARKS_NS (10 * NS_PER_MS) // until markers are looked at again
#define PATIENCE_NS (100 * NS_PER_MS)
#define REQUESTS_LEAST 1024
#define REQUESTS_EACH 16
#define NOTICES_LEAST 64
#define NOTICES_EACH 64

// ---- whom to look at ----------------------------------------------------------------------------

static struct station_runtime *at_place(struct worker *worker, int place) {
    return &worker->runtime->stations[worker_station(worker, place)];
}

static void make_due(struct worker *worker, int place) {
    struct station_runtime *station = at_place(worker, place);
    if (!station->is_due)
        worker->due[worker->due_count++] = place;
    station->is_due = true;
}

// ---- connections --------------------------------------------------------------------------------

static void send_keys(struct worker *worker, struct station_runtime *station) {
    arthron_Control message = {.which_message = arthron_Control_udp_keys_tag};
    datagram_new_epoch(worker->endpoint, station->udp_connection, station, clock_now_ns(),
                       &message.message.udp_keys);
    control_send(*worker->runtime->config.control, station->connection.peer, &message);
}

static void forget_keys(struct worker *worker, struct station_runtime *station) {
    if (station->udp_connection)
        datagram_forget(worker->endpoint, station->udp_connection);
    station->udp_connection = 0;
}

static void station_joined(struct worker *worker, struct station_runtime *station) {
    forget_keys(worker, station);
    frames_end_order(station);
    markers_join(station);
    station->reply.frame_number = station->copied = 0;
    station->frames_lost = station->frames_late = 0;
    atomic_store(&station->counts.datagram_ns, 0);
    for (int bit = 0; bit < EVENT_COUNT; bit++) // those that no reply has told yet are its first
        station->event_counts[bit] = station->events >> bit & 1;
    frames_begin_pause(station);
    devices_begin(&station->device_watch, station->counts.devices);
    station->udp_connection =
        datagram_new_id(worker->endpoint, worker_place(worker->runtime, station->index));
    send_keys(worker, station);
    if (station->connection.confirms_in_replies)
        datagram_challenge_in_replies(worker->endpoint, station->udp_connection);
}

// What the control thread told since the last look; of several changes the newest.
static void take_connection(struct worker *worker, struct station_runtime *station) {
    struct station_connection before = station->connection, *now = &station->connection;
    if (!newest_take(station->connections, now))
        return;
    bool is_new = now->joins != before.joins;
    if (now->connected && is_new)
        station_joined(worker, station);
    if (!now->connected && before.connected)
        forget_keys(worker, station);
    if (now->connected && now->confirms != before.confirms)
        datagram_confirm(worker->endpoint, station->udp_connection, now->challenge);
    if (now->connected && now->clock_known && (is_new || !before.clock_known)) {
        step_announce(worker, station);
        attempts_announce(worker, station);
    }
}

// ---- requests -----------------------------------------------------------------------------------

static bool put(struct worker *worker, const struct worker_request *request) {
    pthread_mutex_lock(&worker->request_lock);
    bool pushed = ring_push(worker->requests, request);
    pthread_mutex_unlock(&worker->request_lock);
    return pushed;
}

static bool take_input(struct worker *worker, struct station_runtime *station,
                       const struct worker_request *request) {
    if (!station->session)
        return false;
    if (request->input == INPUT_UNDO && !step_begin_undo(station, request->ticket))
        return false;
    if (request->input == INPUT_RESET)
        step_void_undo(worker, station);
    if (request->input == INPUT_STOP)
        return step_end(worker, station);
    step_without_frame(worker, station, request->input);
    return true;
}

// Until the cut that is on its way has landed. The cut worker wakes the worker then. What was put
// off waits until the worker may serve, too.
static bool put_off_end(struct worker *worker, struct station_runtime *station,
                        const struct worker_request *request) {
    if (request->kind != REQUEST_INPUT || request->input != INPUT_STOP || !station->session)
        return false;
    bool may_serve = worker_may_serve(worker);
    if (station->ending ? may_serve && !station->job : !may_serve || !station->job)
        return false;
    station->ending = true;
    return put(worker, request);
}

static bool take_remark(struct station_runtime *station, const struct worker_request *request) {
    return station->session && station->session->serial == request->of_session &&
           trace_append_remark(station->session->trace, &request->remark);
}

// What is answered by NOTICE_TAKEN. An attempt that is refused goes back.
static bool do_request(struct worker *worker, struct station_runtime *station,
                       const struct worker_request *request) {
    if (request->kind != REQUEST_ATTEMPT && !worker_may_serve(worker))
        return false;
    switch (request->kind) {
    case REQUEST_INPUT:
        return take_input(worker, station, request);
    case REQUEST_REMARK:
        return take_remark(station, request);
    case REQUEST_ATTEMPT:
        return attempts_take(worker, station, request->attempt);
    default:
        return attempts_leave(worker, station, request->by_trainee);
    }
}

static void take_request(struct worker *worker, const struct worker_request *request) {
    struct station_runtime *station = &worker->runtime->stations[request->station];
    struct runtime_notice notice = {
        .kind = NOTICE_TAKEN, .station = request->station, .ticket = request->ticket};
    if (request->kind == REQUEST_ATTACH) {
        session_begin(worker, station, request->session);
        make_due(worker, worker_place(worker->runtime, station->index));
        return;
    }
    if (request->kind == REQUEST_KEEP) {
        keeping_begin_at_once(&station->keeping);
        return;
    }
    if (request->kind == REQUEST_HAND_OVER) {
        if (station->session)
            step_hand_over(worker, station);
        return;
    }
    if (put_off_end(worker, station, request))
        return;
    notice.done = do_request(worker, station, request);
    worker_notify(worker, &notice);
}

// Those that are there now: more may come all the time.
static void take_requests(struct worker *worker) {
    struct worker_request request;
    for (size_t left = ring_count(worker->requests); left; left--)
        if (ring_pop(worker->requests, &request))
            take_request(worker, &request);
}

// ---- its stations -------------------------------------------------------------------------------

static void publish_trace(struct station_runtime *station) {
    struct trace_status status = trace_writer_status(station->session->trace);
    atomic_store_explicit(&station->counts.trace_missing, status.missing, memory_order_relaxed);
    atomic_store_explicit(&station->counts.trace_failing, status.failing, memory_order_relaxed);
}

// Also what the control thread has noted.
static void tell_slowed(struct worker *worker, struct station_runtime *station, int64_t now_ns) {
    for (int i = 0; i < SLOWED_COUNT; i++) {
        int64_t slowed_ns =
            atomic_load_explicit(&station->counts.slowed_ns[i], memory_order_relaxed);
        int64_t *told_ns = &station->slowed_told_ns[i];
        if (slowed_ns <= *told_ns || (*told_ns && now_ns - *told_ns < FAIR_TELL_NS))
            continue;
        *told_ns = now_ns;
        step_tell(worker, station, slowed_text((enum slowed)i));
    }
}

// Without frames, and its steps would change nothing but their time.
static bool is_at_rest(const struct station_runtime *station, int64_t now_ns) {
    return now_ns - station->last_frame_ns > REST_AFTER_NS && !station->session->attempt &&
           (station->state != SESSION_RUNNING || session_rests(station->session->session));
}

static void watch_time(struct worker *worker, struct station_runtime *station, int64_t now_ns) {
    if (station->connection.connected &&
        datagram_epoch_is_old(worker->endpoint, station->udp_connection, now_ns))
        send_keys(worker, station);
    if (!station->session)
        return;
    publish_trace(station);
    frames_settle(station);
    tell_slowed(worker, station, now_ns);
    if (station->session->pending && step_goes_on(worker, station))
        step_land_pending(worker, station);
    if (!station->session || !worker_may_serve(worker))
        return;
    int64_t pause_ns = is_at_rest(station, now_ns) ? REST_STEP_NS : EMPTY_STEP_NS;
    if (step_is_deserted(worker, station))
        step_end(worker, station);
    else if (step_now_ns(station) - station->last_step_ns >= pause_ns &&
             station->state == SESSION_RUNNING)
        step_without_frame(worker, station, INPUT_EMPTY);
}

// A station that has nothing to do is looked at when somebody calls.
static void look_again(struct worker *worker, const struct station_runtime *station,
                       int64_t now_ns) {
    const struct marking *m = &station->marking;
    int64_t in_ns = station->session && !is_at_rest(station, now_ns) ? EMPTY_STEP_NS : NS_PER_S;
    if (m->holds || m->tells || m->owes || m->done.is_down)
        in_ns = MARKS_NS;
    int64_t when_ns = now_ns + in_ns;
    if (in_ns == NS_PER_S) // together with others
        when_ns -= when_ns % PATIENCE_NS;
    if (station->session || station->connection.connected)
        looks_by(worker->looks, worker_place(worker->runtime, station->index), when_ns);
}

// True where frames are left for the next round.
static bool visit(struct worker *worker, struct station_runtime *station) {
    int64_t now_ns = clock_now_ns();
    bool left = frames_take_tcp(worker, station);
    if (!station->session || step_goes_on(worker, station))
        markers_take(worker, station);
    watch_time(worker, station, now_ns);
    look_again(worker, station, now_ns);
    return left;
}

static struct station_runtime *next_station(struct worker *worker, int *index) {
    struct runtime *runtime = worker->runtime;
    *index += *index < 0 ? 1 + worker->index : runtime->worker_count;
    return *index < runtime->config.station_count ? &runtime->stations[*index] : NULL;
}

// True where some are due again.
static bool visit_due(struct worker *worker) {
    for (int place; (place = looks_take(worker->looks, clock_now_ns())) >= 0;)
        make_due(worker, place);
    int count = worker->due_count;
    worker->due_count = 0;
    for (int i = 0; i < count; i++) {
        struct station_runtime *station = at_place(worker, worker->due[i]);
        station->is_due = visit(worker, station);
        if (station->is_due)
            worker->due[worker->due_count++] = worker->due[i];
    }
    return worker->due_count > 0;
}

static void take_calls(struct worker *worker) {
    int index;
    while (ring_pop(worker->called, &index)) {
        struct station_runtime *station = &worker->runtime->stations[index];
        atomic_exchange(&station->called, false); // what was left before it was called is seen
        take_connection(worker, station);
        make_due(worker, worker_place(worker->runtime, index));
    }
}

// True once all have ended.
static bool end_sessions(struct worker *worker) {
    bool ended = true;
    struct station_runtime *station;
    for (int i = -1; (station = next_station(worker, &i));)
        if (station->session && worker->runtime->hand_over)
            step_hand_over(worker, station);
        else if (station->session)
            ended &= step_end(worker, station);
    return ended;
}

// ---- the thread ---------------------------------------------------------------------------------

// Until a frame or a word from another thread comes, or it is time to look at a station.
static void wait_for_work(struct worker *worker, struct pollfd *fds, bool left) {
    uint64_t wakes;
    int64_t begin_ns = clock_now_ns();
    int64_t wait_ns = looks_next_ns(worker->looks, begin_ns + PATIENCE_NS) - begin_ns;
    bool waits = !left && wait_ns > 0;
    poll(fds, 2, waits ? (int)(wait_ns / NS_PER_MS) + 1 : 0);
    real_time_waited(&worker->real_time, begin_ns, clock_now_ns());
    if (fds[1].revents && read(fds[1].fd, &wakes, sizeof wakes) < 0)
        CHECK(errno == EAGAIN);
}

static void begin_real_time(struct worker *worker) {
    bool given = real_time_begin(&worker->real_time, clock_now_ns());
    if (worker->index > 0)
        return;
    if (given)
        log_info("runtime", "workers run at real-time priority %d", REAL_TIME_PRIORITY);
    else
        log_info("runtime",
                 "no real-time priority for workers, as the limit RTPRIO is below %d: "
                 "other programs may delay poses (INSTALL.md)",
                 REAL_TIME_PRIORITY);
}

static void *run_worker(void *argument) {
    struct worker *worker = argument;
    struct pollfd fds[2] = {
        {.fd = datagram_fd(worker->endpoint), .events = POLLIN},
        {.fd = worker->wake_fd, .events = POLLIN},
    };
    bool left = false;
    progress_begin(&worker->progress, "worker", worker->index);
    begin_real_time(worker);
    while (!atomic_load(&worker->runtime->stop)) {
        progress_note(&worker->progress, "wait for frames and requests", -1);
        wait_for_work(worker, fds, left);
        progress_note(&worker->progress, "take connections and requests", -1);
        take_calls(worker);
        take_requests(worker);
        step_results(worker);
        frames_take_datagrams(worker);
        left = visit_due(worker);
    }
    take_requests(worker);
    while (!end_sessions(worker)) {
        progress_note(&worker->progress, "wait for the last cuts", -1);
        while (looks_take(worker->looks, clock_now_ns()) >= 0)
            ; // nobody is looked at any more
        wait_for_work(worker, fds, false);
        step_results(worker);
    }
    progress_end(&worker->progress);
    return NULL;
}

bool worker_request(struct worker *worker, const struct worker_request *request) {
    bool pushed = put(worker, request);
    if (pushed)
        wake_fd(worker->wake_fd);
    return pushed;
}

enum result worker_start(struct runtime *runtime, int index, struct error *err) {
    struct worker *worker = &runtime->workers[index];
    const struct runtime_config *config = &runtime->config;
    int port = config->udp_port ? config->udp_port + index : 0;
    const char *address = config->address[0] ? config->address : NULL;
    worker->runtime = runtime;
    worker->index = index;
    pthread_mutex_init(&worker->request_lock, NULL);
    enum result result =
        datagram_create(address, port, worker_stations(runtime, index), &worker->endpoint, err);
    if (result != RESULT_OK)
        return result;
    worker->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    NEED(worker->wake_fd >= 0, "descriptor");
    size_t requests = worker_room(runtime, index, REQUESTS_EACH, REQUESTS_LEAST);
    size_t notices = worker_room(runtime, index, NOTICES_EACH, NOTICES_LEAST);
    worker->requests = ring_create(requests, sizeof(struct worker_request));
    worker->notices = ring_create(notices, sizeof(struct runtime_notice));
    int stations = worker_stations(runtime, index);
    worker->called = ring_create(worker_room(runtime, index, 1, 1), sizeof(int));
    worker->looks = looks_create(stations);
    worker->due = alloc((size_t)stations, sizeof *worker->due);
    worker->image = session_image_create();
    worker->cut_worker = cut_worker_create(worker);
    int failed = pthread_create(&worker->thread, NULL, run_worker, worker);
    NEED(!failed, "thread");
    return RESULT_OK;
}

void worker_stop(struct worker *worker) {
    if (!worker->endpoint)
        return;
    pthread_join(worker->thread, NULL);
    cut_worker_stop(worker->cut_worker);
    datagram_destroy(&worker->endpoint);
}

void worker_release(struct worker *worker) {
    if (worker->wake_fd > 0)
        close(worker->wake_fd);
    ring_destroy(&worker->requests);
    ring_destroy(&worker->notices);
    ring_destroy(&worker->called);
    looks_destroy(&worker->looks);
    free(worker->due);
    cut_worker_destroy(&worker->cut_worker);
    session_image_destroy(&worker->image);
    pthread_mutex_destroy(&worker->request_lock);
}
