// A worker: one thread, one datagram socket, the sessions of its seats. Nothing in here waits for
// anyone: rings to and from the other threads, non-blocking sends, a trace that only copies.
#include "base/check.h"
#include "base/clock.h"
#include "hub/reply.h"
#include "hub/seat.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/random.h>
#include <unistd.h>

#define EMPTY_STEP_NS (50 * NS_PER_MS)
#define TICK_MS 10
#define RING_NOTES 1024

// Where an answer goes.
enum path { PATH_CONTROL, PATH_DATAGRAM };

// ---- steps --------------------------------------------------------------------------------------

static bool seat_is_deserted(const struct hub *hub, const struct seat *seat) {
    return !seat->connected && clock_now_ns() - seat->last_frame_ns > hub->config.wait_s * NS_PER_S;
}

static void retire(struct worker *worker, struct seat *seat) {
    struct hub *hub = worker->hub;
    theatre_close(worker->theatre, (int)(seat - hub->seats), seat->live,
                  seat_is_deserted(hub, seat));
    seat->live = NULL;
}

// Tells a station what its session is; from the first of these on it sends frames.
static void announce(struct worker *worker, const struct seat *seat) {
    if (!seat->connected || !seat->clock_known || !seat->live)
        return;
    arthron_Control message = {.which_message = arthron_Control_session_change_tag};
    reply_session((enum session_state)atomic_load(&seat->counts.state),
                  scene_case(seat->live->scene), &message.message.session_change);
    control_send(worker->hub->control, seat->peer, &message);
}

// For those who look on.
static void show(struct seat *seat, const struct session_output *output) {
    double warp_mm = 0;
    struct moments *moments = &seat->live->moments;
    moments_step(moments, output);
    newest_put(seat->moment_news, &moments->now);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        warp_mm = fmax(warp_mm, moments->now.instruments[i].warp_mm);
    int64_t warp_nm = (int64_t)(warp_mm * 1e6);
    if (warp_nm > atomic_load_explicit(&seat->counts.warp_nm, memory_order_relaxed))
        atomic_store_explicit(&seat->counts.warp_nm, warp_nm, memory_order_relaxed);
}

static void advance(struct worker *worker, struct seat *seat, struct session_input *input,
                    struct session_output *output) {
    if (input->time_ns < seat->last_step_ns)
        input->time_ns = seat->last_step_ns;
    seat->last_step_ns = input->time_ns;
    session_step(seat->live->session, input, output);
    trace_append(seat->live->trace, input, output);
    atomic_store_explicit(&seat->counts.steps, output->step, memory_order_relaxed);
    tally_step(seat, input, output);
    show(seat, output);
    seat->events |= output->events;
    if (output->events & EVENT_STATE) {
        atomic_store(&seat->counts.state, (int)output->state);
        announce(worker, seat);
    }
    if (output->state == SESSION_CLOSED)
        retire(worker, seat);
}

static void order_job(struct worker *worker, const struct seat *seat,
                      const struct session_output *output) {
    if (output->job.id)
        theatre_run(worker->theatre, (int)(seat - worker->hub->seats), seat->live, &output->job);
}

static void step(struct worker *worker, struct seat *seat, struct session_input *input,
                 struct session_output *output) {
    advance(worker, seat, input, output);
    order_job(worker, seat, output);
}

// On the session's clock, which is the server's, unless it began before that did.
static int64_t session_now_ns(const struct seat *seat) {
    return clock_now_ns() + seat->live->ahead_ns;
}

static void step_without_frame(struct worker *worker, struct seat *seat, enum input_kind kind) {
    struct session_input input = {.kind = kind, .time_ns = session_now_ns(seat)};
    struct session_output output;
    step(worker, seat, &input, &output);
}

static void land(struct worker *worker, struct seat *seat, struct job_result *result,
                 struct session_output *out) {
    struct session_input input = {
        .kind = INPUT_JOB, .time_ns = session_now_ns(seat), .job = result->job, .result = result};
    advance(worker, seat, &input, out);
}

// A session that has ended since takes its results with it. The job that a landing step asks for
// goes behind the result: the theatre tells stations of a result while the mesh is still as it left
// it.
static void take_results(struct worker *worker) {
    int index;
    uint64_t serial;
    struct job_result *result;
    while (theatre_take(worker->theatre, &index, &serial, &result)) {
        struct seat *seat = &worker->hub->seats[index];
        struct session_output output = {0};
        if (seat->live && seat->live->serial == serial)
            land(worker, seat, result, &output);
        theatre_landed(worker->theatre, index, serial, result);
        order_job(worker, seat, &output);
    }
}

// ---- drift --------------------------------------------------------------------------------------

static void publish_drift(struct seat *seat) {
    double largest_mm = 0;
    uint64_t touches = 0;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        touches += seat->drift[i].touches;
        largest_mm = fmax(largest_mm, seat->drift[i].mean_mm);
    }
    atomic_store(&seat->counts.touches, touches);
    atomic_store(&seat->counts.drift_nm, (int64_t)(largest_mm * 1e6));
}

static void forget_drift(struct seat *seat) {
    memset(seat->drift, 0, sizeof seat->drift);
    atomic_store(&seat->counts.touches, 0);
    atomic_store(&seat->counts.drift_nm, 0);
}

static void watch_drift(const struct worker *worker, struct seat *seat,
                        const struct session_output *output) {
    double reach_mm = worker->hub->config.settings.field.radius_mm;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct instrument_output *o = &output->instruments[i];
        bool closed = o->handle.buttons & seat->station->contact_buttons[i];
        bool measured = o->present && o->validity == VALIDITY_OK;
        double nearest_mm = isfinite(o->warp.nearest_mm) ? o->warp.nearest_mm : reach_mm;
        if (drift_step(&seat->drift[i], closed, measured ? nearest_mm : -1))
            publish_drift(seat);
    }
}

// ---- frames -------------------------------------------------------------------------------------

static void count(atomic_uint_fast64_t *counter, uint64_t by) {
    atomic_fetch_add_explicit(counter, by, memory_order_relaxed);
}

// Drops what is old or early; on true the frame is the newest of its connection.
static bool accept_frame(struct seat *seat, const struct frame *frame) {
    if (!seat->clock_known || !seat->live) {
        count(&seat->counts.frames_early, 1);
        return false;
    }
    if (frame->number <= seat->last_frame) {
        count(&seat->counts.frames_old, 1);
        return false;
    }
    if (seat->last_frame)
        count(&seat->counts.frames_lost, frame->number - seat->last_frame - 1);
    seat->last_frame = frame->number;
    return true;
}

static void onto_session_clock(struct frame *frame, int64_t offset_ns) {
    frame->time_ns += offset_ns;
    for (int i = 0; i < frame->count; i++)
        frame->samples[i].time_ns += offset_ns;
}

static void answer(struct worker *worker, struct seat *seat, enum path path,
                   const arthron_Reply *reply) {
    if (path == PATH_DATAGRAM) {
        datagram_reply(worker->endpoint, seat->udp_connection, reply);
        return;
    }
    arthron_Control message = {.which_message = arthron_Control_reply_tag};
    message.message.reply = *reply;
    control_send(worker->hub->control, seat->peer, &message);
}

// A station that tries whether datagrams pass sends a frame on both paths; the second copy gets the
// same answer on its own path.
static bool is_second_copy(const struct seat *seat, const struct frame *frame) {
    return frame->number && frame->number == seat->reply.frame_number;
}

static void take_frame(struct worker *worker, struct seat *seat, enum path path,
                       const struct frame *frame, int64_t received_ns) {
    if (is_second_copy(seat, frame)) {
        answer(worker, seat, path, &seat->reply);
        return;
    }
    if (!accept_frame(seat, frame))
        return;
    devices_step(&seat->device_watch, frame, seat->counts.devices);
    const struct knee_case *knee = scene_case(seat->live->scene);
    int64_t ahead_ns = seat->live->ahead_ns;
    struct session_input input = {
        .kind = INPUT_FRAME, .time_ns = received_ns + ahead_ns, .frame = *frame};
    struct session_output output;
    onto_session_clock(&input.frame, seat->clock_offset_ns + ahead_ns);
    seat->last_frame_ns = received_ns;
    step(worker, seat, &input, &output);
    watch_drift(worker, seat, &output);
    reply_from_output(&output, knee, frame->number, frame->time_ns, &seat->reply);
    seat->reply.events = seat->events;
    seat->events = 0;
    answer(worker, seat, path, &seat->reply);
}

static void ask_for_path(struct worker *worker, const struct seat *seat, uint64_t challenge) {
    arthron_Control message = {.which_message = arthron_Control_udp_path_tag};
    message.message.udp_path.challenge = challenge;
    control_send(worker->hub->control, seat->peer, &message);
}

static void publish_counts(struct worker *worker) {
    struct datagram_counts now = datagram_counts(worker->endpoint);
    struct worker_counts *counts = &worker->counts;
    atomic_store_explicit(&counts->strangers, now.strangers, memory_order_relaxed);
    atomic_store_explicit(&counts->forged, now.forged, memory_order_relaxed);
    atomic_store_explicit(&counts->replayed, now.replayed, memory_order_relaxed);
    atomic_store_explicit(&counts->malformed, now.malformed, memory_order_relaxed);
    atomic_store_explicit(&counts->too_long, now.too_long, memory_order_relaxed);
}

static void take_datagrams(struct worker *worker) {
    static _Thread_local struct datagram_in batch[DATAGRAM_BATCH];
    int received = datagram_receive(worker->endpoint, batch);
    for (int i = 0; i < received; i++) {
        struct seat *seat = batch[i].user;
        struct frame frame;
        if (batch[i].path_challenge)
            ask_for_path(worker, seat, batch[i].path_challenge);
        if (wire_frame_to(&batch[i].message, &frame, NULL) != RESULT_OK)
            count(&seat->counts.frames_invalid, 1);
        else
            take_frame(worker, seat, PATH_DATAGRAM, &frame, batch[i].received_ns);
    }
    datagram_flush(worker->endpoint);
    publish_counts(worker);
}

// ---- notes --------------------------------------------------------------------------------------

static void send_keys(struct worker *worker, struct seat *seat) {
    arthron_Control message = {.which_message = arthron_Control_udp_keys_tag};
    datagram_new_epoch(worker->endpoint, seat->udp_connection, seat, clock_now_ns(),
                       &message.message.udp_keys);
    control_send(worker->hub->control, seat->peer, &message);
}

static uint32_t random_connection(void) {
    uint32_t connection = 0;
    while (!connection)
        if (getrandom(&connection, sizeof connection, 0) != sizeof connection)
            connection = 0;
    return connection;
}

static void station_joined(struct worker *worker, struct seat *seat, struct control_peer peer) {
    if (seat->udp_connection)
        datagram_forget(worker->endpoint, seat->udp_connection);
    seat->connected = true;
    seat->peer = peer;
    seat->clock_known = false;
    seat->last_frame = 0;
    seat->reply.frame_number = 0;
    seat->last_frame_ns = clock_now_ns();
    devices_begin(&seat->device_watch, seat->counts.devices);
    seat->udp_connection = random_connection();
    send_keys(worker, seat);
}

static void station_gone(struct worker *worker, struct seat *seat) {
    seat->connected = false;
    seat->clock_known = false;
    datagram_forget(worker->endpoint, seat->udp_connection);
    seat->udp_connection = 0;
}

static void clear_counts(struct seat_counts *counts) {
    atomic_store(&counts->frames_lost, 0);
    atomic_store(&counts->frames_old, 0);
    atomic_store(&counts->frames_early, 0);
    atomic_store(&counts->frames_invalid, 0);
}

// What was cut when the server was killed.
static void land_pending(struct worker *worker, struct seat *seat) {
    int index = (int)(seat - worker->hub->seats);
    struct session_output output;
    struct job_result *result = seat->live->pending;
    seat->live->pending = NULL;
    land(worker, seat, result, &output);
    theatre_landed(worker->theatre, index, seat->live->serial, result);
    order_job(worker, seat, &output);
}

static void attach(struct worker *worker, struct seat *seat, struct live *live) {
    CHECK(!seat->live);
    seat->live = live;
    theatre_open(worker->theatre, (int)(seat - worker->hub->seats), live);
    forget_drift(seat);
    clear_counts(&seat->counts);
    seat->last_frame = 0;
    seat->events = 0;
    seat->last_step_ns = live->last_ns;
    newest_put(seat->tallies, &live->tally);
    seat->tally_ns = live->last_ns;
    seat->last_frame_ns = clock_now_ns();
    atomic_store(&seat->counts.state, (int)live->state);
    if (live->pending)
        land_pending(worker, seat);
    step_without_frame(worker, seat, INPUT_EMPTY);
    // One that was cut off before it had started has its start still to come.
    if (live->state == SESSION_WAITING && !seat->station->start_by_command)
        step_without_frame(worker, seat, INPUT_START);
    else
        announce(worker, seat);
}

static bool is_of_peer(const struct seat *seat, const struct note *note) {
    return seat->connected && seat->peer.index == note->peer.index &&
           seat->peer.generation == note->peer.generation;
}

static void take_note(struct worker *worker, const struct note *note) {
    struct seat *seat = &worker->hub->seats[note->seat];
    switch (note->kind) {
    case NOTE_JOINED:
        station_joined(worker, seat, note->peer);
        break;
    case NOTE_GONE:
        if (is_of_peer(seat, note))
            station_gone(worker, seat);
        break;
    case NOTE_CLOCK:
        if (is_of_peer(seat, note)) {
            bool ready = seat->clock_known;
            seat->clock_known = true;
            seat->clock_offset_ns = note->clock_offset_ns;
            if (!ready)
                announce(worker, seat);
        }
        break;
    case NOTE_FRAME:
        if (is_of_peer(seat, note))
            take_frame(worker, seat, PATH_CONTROL, &note->frame, note->received_ns);
        break;
    case NOTE_CONFIRM:
        if (is_of_peer(seat, note))
            datagram_confirm(worker->endpoint, seat->udp_connection, note->challenge);
        break;
    case NOTE_ATTACH:
        attach(worker, seat, note->live);
        break;
    case NOTE_REMARK: // what a full buffer does not take is told of as the steps are that it lacks
        if (seat->live && seat->live->serial == note->session)
            trace_append_remark(seat->live->trace, &note->remark);
        break;
    case NOTE_INPUT:
        if (seat->live)
            step_without_frame(worker, seat, note->input);
        atomic_fetch_add(&seat->counts.inputs, 1);
        break;
    }
}

static void take_notes(struct worker *worker) {
    struct note note;
    while (ring_pop(worker->from_desk, &note))
        take_note(worker, &note);
    while (ring_pop(worker->from_control, &note))
        take_note(worker, &note);
}

// ---- time ---------------------------------------------------------------------------------------

static void publish_trace(struct seat *seat) {
    struct trace_status status = trace_writer_status(seat->live->trace);
    atomic_store_explicit(&seat->counts.trace_missing, status.missing, memory_order_relaxed);
    atomic_store_explicit(&seat->counts.trace_failing, status.failing, memory_order_relaxed);
}

static void watch_seat(struct worker *worker, struct seat *seat, int64_t now_ns) {
    if (seat->connected && datagram_epoch_is_old(worker->endpoint, seat->udp_connection, now_ns))
        send_keys(worker, seat);
    if (!seat->live)
        return;
    publish_trace(seat);
    if (seat_is_deserted(worker->hub, seat)) {
        step_without_frame(worker, seat, INPUT_STOP);
    } else if (now_ns + seat->live->ahead_ns - seat->last_step_ns >= EMPTY_STEP_NS &&
               atomic_load(&seat->counts.state) == SESSION_RUNNING) {
        step_without_frame(worker, seat, INPUT_EMPTY);
    }
}

static void for_own_seats(struct worker *worker,
                          void (*visit)(struct worker *, struct seat *, int64_t)) {
    struct hub *hub = worker->hub;
    int64_t now_ns = clock_now_ns();
    for (int i = worker->index; i < hub->config.station_count; i += hub->worker_count)
        visit(worker, &hub->seats[i], now_ns);
}

static void end_session(struct worker *worker, struct seat *seat, int64_t now_ns) {
    (void)now_ns;
    if (seat->live)
        step_without_frame(worker, seat, INPUT_STOP);
}

// ---- thread -------------------------------------------------------------------------------------

static void *work(void *argument) {
    struct worker *worker = argument;
    struct pollfd fds[2] = {
        {.fd = datagram_fd(worker->endpoint), .events = POLLIN},
        {.fd = worker->wake_fd, .events = POLLIN},
    };
    while (!atomic_load(&worker->hub->workers_stop)) {
        poll(fds, 2, TICK_MS);
        uint64_t wakes;
        if (fds[1].revents && read(worker->wake_fd, &wakes, sizeof wakes) < 0)
            CHECK(errno == EAGAIN);
        take_notes(worker);
        take_results(worker);
        take_datagrams(worker);
        for_own_seats(worker, watch_seat);
    }
    take_notes(worker);
    for_own_seats(worker, end_session);
    return NULL;
}

bool worker_tell(struct worker *worker, struct ring *ring, const struct note *note) {
    if (!ring_push(ring, note))
        return false;
    uint64_t one = 1;
    return write(worker->wake_fd, &one, sizeof one) == sizeof one || errno == EAGAIN;
}

enum result worker_start(struct hub *hub, int index, struct error *err) {
    struct worker *worker = &hub->workers[index];
    const struct hub_config *config = &hub->config;
    int port = config->udp_port ? config->udp_port + index : 0;
    const char *address = config->address[0] ? config->address : NULL;
    worker->hub = hub;
    worker->index = index;
    enum result result = datagram_create(address, port, &worker->endpoint, err);
    if (result != RESULT_OK)
        return result;
    worker->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    CHECK(worker->wake_fd >= 0);
    worker->from_control = ring_create(RING_NOTES, sizeof(struct note));
    worker->from_desk = ring_create(RING_NOTES, sizeof(struct note));
    theatre_start(worker);
    int failed = pthread_create(&worker->thread, NULL, work, worker);
    CHECK(!failed);
    return RESULT_OK;
}

void worker_stop(struct worker *worker) {
    if (!worker->endpoint)
        return;
    atomic_store(&worker->hub->workers_stop, true);
    pthread_join(worker->thread, NULL);
    theatre_stop(worker);
    datagram_destroy(&worker->endpoint);
}

void worker_release(struct worker *worker) {
    if (worker->wake_fd > 0)
        close(worker->wake_fd);
    ring_destroy(&worker->from_control);
    ring_destroy(&worker->from_desk);
    theatre_release(worker);
}
