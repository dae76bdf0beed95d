#include "runtime/frames.h"

#include "base/clock.h"
#include "runtime/reply.h"
#include "runtime/stepping.h"

#include <math.h>
#include <string.h>

#define TCP_FRAMES_AT_ONCE 4
#define BATCHES_AT_ONCE 4
#define REPLIES_TOGETHER 8 // in one call of the system: more would wait for one another's steps

_Static_assert(sizeof((arthron_Reply *)0)->event_counts / sizeof(uint32_t) >= EVENT_COUNT,
               "a reply counts every event");

// Where an answer goes.
enum reply_path { PATH_CONTROL, PATH_DATAGRAM };

static void count(atomic_uint_fast64_t *counter, uint64_t by) {
    atomic_fetch_add_explicit(counter, by, memory_order_relaxed);
}

// ---- drift --------------------------------------------------------------------------------------

static void publish_drift(struct station_runtime *station) {
    double largest_mm = 0;
    uint64_t touches = 0;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        touches += station->drift[i].touches;
        largest_mm = fmax(largest_mm, station->drift[i].mean_mm);
    }
    atomic_store(&station->counts.touches, touches);
    atomic_store(&station->counts.drift_nm, (int64_t)(largest_mm * 1e6));
}

static void watch_drift(const struct worker *worker, struct station_runtime *station,
                        const struct session_output *output) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct instrument_output *o = &output->instruments[i];
        bool closed = o->handle.buttons & station->config->contact_buttons[i];
        bool measured = o->present && o->validity == VALIDITY_OK;
        double reach_mm = worker->runtime->config.touch_reach_mm;
        double nearest_mm = isfinite(o->warp.nearest_mm) ? o->warp.nearest_mm : reach_mm;
        if (drift_step(&station->drift[i], closed, measured ? nearest_mm : -1))
            publish_drift(station);
    }
}

// ---- one frame ----------------------------------------------------------------------------------

static void count_lost(struct station_runtime *station, uint64_t lost) {
    count_frames(&station->counts, &station->counts.frames_lost, FATE_LOST, lost);
    station->frames_lost += (uint32_t)lost;
}

// A frame that is beyond the station's share is left out, and no lost one.
static bool is_in_share(struct station_runtime *station, int64_t received_ns) {
    if (fair_share_take(&station->share, received_ns))
        return true;
    count_frames(&station->counts, &station->counts.frames_excess, FATE_EXCESS, 1);
    atomic_store_explicit(&station->counts.slowed_ns[SLOWED_FRAMES], received_ns,
                          memory_order_relaxed);
    return false;
}

// By its own time: what waited in a socket is old, however late it is read.
static bool may_be_taken(const struct worker *worker, const struct station_runtime *station,
                         const struct frame *frame) {
    int64_t offset_ns = clock_bridge_now(&station->bridge, station->connection.clock_offset_ns);
    return worker_may_serve(worker) || clock_now_ns() - (frame->time_ns + offset_ns) <= FRESH_NS;
}

// On true the frame is the newest of its connection, with what late ones told.
static bool accept_frame(struct worker *worker, struct station_runtime *station,
                         struct frame *frame, int64_t received_ns, bool in_share) {
    if (!station->connection.clock_known || !station->session) {
        count_frames(&station->counts, &station->counts.frames_early, FATE_EARLY, 1);
        return false;
    }
    uint64_t lost;
    enum frame_place place = frame_order_note(&station->order, frame->number, received_ns, &lost);
    count_lost(station, lost);
    if ((place == FRAME_NEWEST || place == FRAME_LATE) && !may_be_taken(worker, station, frame))
        place = FRAME_OLD;
    switch (place) {
    case FRAME_NEWEST:
        if (!in_share)
            return false;
        late_frames_merge(&station->late, frame, worker->runtime->config.hold_ns);
        return true;
    case FRAME_LATE:
        count_frames(&station->counts, &station->counts.frames_late, FATE_LATE, 1);
        station->frames_late++;
        if (in_share)
            late_frames_keep(&station->late, frame);
        return false;
    case FRAME_OLD:
        count_frames(&station->counts, &station->counts.frames_old, FATE_OLD, 1);
        return false;
    case FRAME_WRONG:
        count_frames(&station->counts, &station->counts.frames_invalid, FATE_INVALID, 1);
        return false;
    }
    return false;
}

void frames_end_order(struct station_runtime *station) {
    count_lost(station, frame_order_end(&station->order));
    memset(&station->late, 0, sizeof station->late);
    memset(&station->bridge, 0, sizeof station->bridge);
}

void frames_settle(struct station_runtime *station) {
    count_lost(station, frame_order_settle(&station->order, clock_now_ns()));
}

static void onto_session_clock(struct frame *frame, int64_t offset_ns) {
    frame->time_ns += offset_ns;
    for (int i = 0; i < frame->count; i++)
        frame->samples[i].time_ns += offset_ns;
}

static int64_t offset_of(struct station_runtime *station, const struct frame *frame,
                         int64_t received_ns) {
    int64_t step_ns;
    int64_t offset_ns = clock_bridge_offset(&station->bridge, frame->time_ns, received_ns,
                                            station->connection.clock_offset_ns, &step_ns);
    if (step_ns) {
        atomic_store(&station->counts.clock_step_ns, step_ns);
        atomic_store(&station->counts.clock_stepped_ns, received_ns);
        count(&station->counts.clock_steps, 1);
    }
    return offset_ns;
}

static void answer(struct worker *worker, struct station_runtime *station, enum reply_path path) {
    if (path == PATH_DATAGRAM) {
        datagram_reply(worker->endpoint, station->udp_connection, &station->reply);
        return;
    }
    arthron_Control message = {.which_message = arthron_Control_reply_tag};
    message.message.reply = station->reply;
    control_send(*worker->runtime->config.control, station->connection.peer, &message);
}

// A station that tries whether datagrams pass sends a frame on both paths. The second copy gets the
// same answer on its own path, and a third one gets none.
static bool is_copy(const struct station_runtime *station, const struct frame *frame) {
    return frame->number && frame->number == station->reply.frame_number;
}

static void answer_copy(struct worker *worker, struct station_runtime *station,
                        enum reply_path path) {
    if (station->copied == station->reply.frame_number) {
        count_frames(&station->counts, &station->counts.frames_old, FATE_OLD, 1);
        return;
    }
    station->copied = station->reply.frame_number;
    answer(worker, station, path);
}

static void take_events(struct station_runtime *station) {
    station->reply.events = station->events;
    station->events = 0;
    station->reply.event_counts_count = EVENT_COUNT;
    memcpy(station->reply.event_counts, station->event_counts, sizeof station->event_counts);
}

void frames_begin_pause(struct station_runtime *station) {
    station->last_frame_ns = clock_now_ns();
    atomic_store_explicit(&station->counts.frame_ns, station->last_frame_ns, memory_order_relaxed);
}

static void end_pause(struct station_counts *counts, int64_t received_ns) {
    int64_t pause_ns = received_ns - atomic_load_explicit(&counts->frame_ns, memory_order_relaxed);
    atomic_store_explicit(&counts->frame_ns, received_ns, memory_order_relaxed);
    if (pause_ns > atomic_load_explicit(&counts->pause_ns, memory_order_relaxed))
        atomic_store_explicit(&counts->pause_ns, pause_ns, memory_order_relaxed);
}

static void tell_frames(struct station_runtime *station) {
    station->reply.has_frames_lost = station->reply.has_frames_late = true;
    station->reply.frames_lost = station->frames_lost;
    station->reply.frames_late = station->frames_late;
}

static void take_frame(struct worker *worker, struct station_runtime *station, enum reply_path path,
                       struct frame *frame, int64_t received_ns) {
    if (path == PATH_DATAGRAM)
        atomic_store_explicit(&station->counts.datagram_ns, received_ns, memory_order_relaxed);
    end_pause(&station->counts, received_ns);
    bool in_share = is_in_share(station, received_ns);
    if (is_copy(station, frame)) {
        if (in_share)
            answer_copy(worker, station, path);
        return;
    }
    if (!accept_frame(worker, station, frame, received_ns, in_share))
        return;
    devices_step(&station->device_watch, frame, station->counts.devices);
    const struct knee_case *knee = scene_case(station->session->scene);
    int64_t ahead_ns = station->session->ahead_ns;
    struct session_input input = {
        .kind = INPUT_FRAME, .time_ns = received_ns + ahead_ns, .frame = *frame};
    struct session_output output;
    onto_session_clock(&input.frame, offset_of(station, frame, received_ns) + ahead_ns);
    station->last_frame_ns = received_ns;
    step_input(worker, station, &input, &output);
    count(&station->counts.fates[FATE_TAKEN], 1);
    watch_drift(worker, station, &output);
    reply_from_output(&output, knee, frame->number, frame->time_ns, &station->reply);
    take_events(station);
    tell_frames(station);
    answer(worker, station, path);
    latency_add(&worker->answers, clock_now_ns() - received_ns);
}

// ---- both paths ---------------------------------------------------------------------------------

static void ask_for_path(struct worker *worker, const struct station_runtime *station,
                         uint64_t challenge) {
    arthron_Control message = {.which_message = arthron_Control_udp_path_tag};
    message.message.udp_path.challenge = challenge;
    control_send(*worker->runtime->config.control, station->connection.peer, &message);
}

static void publish_counts(struct worker *worker) {
    struct datagram_counts now = datagram_counts(worker->endpoint);
    atomic_store_explicit(&worker->counts.strangers, now.strangers, memory_order_relaxed);
    atomic_store_explicit(&worker->counts.forged, now.forged, memory_order_relaxed);
    atomic_store_explicit(&worker->counts.replayed, now.replayed, memory_order_relaxed);
    atomic_store_explicit(&worker->counts.malformed, now.malformed, memory_order_relaxed);
    atomic_store_explicit(&worker->counts.too_long, now.too_long, memory_order_relaxed);
}

static void take_datagram(struct worker *worker, struct datagram_in *datagram) {
    struct station_runtime *station = datagram->user;
    progress_note(&worker->progress, "take a datagram", station->index);
    if (datagram->path_challenge)
        ask_for_path(worker, station, datagram->path_challenge);
    if (datagram->is_valid)
        take_frame(worker, station, PATH_DATAGRAM, &datagram->frame, datagram->received_ns);
    else
        count_frames(&station->counts, &station->counts.frames_invalid, FATE_INVALID, 1);
}

static int take_batch(struct worker *worker) {
    static _Thread_local struct datagram_in batch[DATAGRAM_BATCH];
    int received = datagram_receive(worker->endpoint, batch);
    for (int i = 0; i < received; i++) {
        take_datagram(worker, &batch[i]);
        if (i % REPLIES_TOGETHER == REPLIES_TOGETHER - 1)
            datagram_flush(worker->endpoint);
    }
    datagram_flush(worker->endpoint);
    return received;
}

// All that wait, within bounds: a worker has more to do.
void frames_take_datagrams(struct worker *worker) {
    for (int i = 0; i < BATCHES_AT_ONCE && take_batch(worker) == DATAGRAM_BATCH; i++)
        ;
    publish_counts(worker);
}

bool frames_take_tcp(struct worker *worker, struct station_runtime *station) {
    struct tcp_frame next;
    for (int i = 0; i < TCP_FRAMES_AT_ONCE; i++) {
        if (!ring_pop(station->frames, &next))
            return false;
        progress_note(&worker->progress, "take a frame of the control connection", station->index);
        if (station->connection.connected && next.joins == station->connection.joins)
            take_frame(worker, station, PATH_CONTROL, &next.frame, next.received_ns);
    }
    return ring_count(station->frames) > 0;
}
