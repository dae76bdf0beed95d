#include "sim/watch.h"

#include "base/check.h"
#include "base/clock.h"
#include "net/datagram.h"
#include "sessions/sessions.h"
#include "sim/disk.h"
#include "sim/hall.h"
#include "sim/ledger.h"
#include "sim/report.h"
#include "sim/station.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FRAMES 2048 // that are remembered, a power of two
#define FAIR_AFTER_NS (3 * NS_PER_S)
#define WAIT_NS (8 * NS_PER_MS) // a frame's way, and a turn of the worker
#define SHOWN_OFF_MM 1.0        // of a tip that the view leads on, while the network is fair

struct sent_frame {
    uint64_t number, connection;
    int64_t incarnation, sent_ns, shown_ns;
    bool shown[INSTRUMENT_COUNT];
    vec3 warped[INSTRUMENT_COUNT];
};

static struct {
    int count;
    struct watch_counts counts;
    struct watched {
        struct sent_frame frames[FRAMES];
        uint64_t sent, accepted, last_number, last_answerable;
        int64_t viewed_ns, view_incarnation, last_pose_ns;
        struct ledger *session; // of the last step
        int64_t unfair_ns;      // when the network was last not fair
        int64_t shown_ahead_ns; // of the station's clock at the last view
        // How often each event came: at the steps, as shown, and both as the last
        // connection began.
        uint32_t events[EVENT_COUNT], shown_events[EVENT_COUNT];
        uint32_t first_events[EVENT_COUNT], first_shown[EVENT_COUNT];
        int64_t time_ns;
    } stations[SIM_STATIONS_MAX];
} watch;

void watch_begin(int stations) {
    memset(&watch, 0, sizeof watch);
    watch.count = stations;
    ledgers_begin();
}

void watch_end(void) {
    ledgers_end();
}

struct watch_counts watch_counts(void) {
    struct watch_counts counts = watch.counts;
    ledgers_count(&counts);
    return counts;
}

// ---- stations -----------------------------------------------------------------------------------

void watch_began(int station) {
    watch.stations[station].last_number = 0;
}

static bool is_fair(int station) {
    struct weather fair = net_fair(station);
    struct watched *w = &watch.stations[station];
    if (memcmp(&fair, net_weather(station), sizeof fair) || sim_stalls.on || !hall_is_up())
        w->unfair_ns = sim_now_ns();
    return sim_now_ns() - w->unfair_ns > FAIR_AFTER_NS;
}

void watch_sent(int station, int64_t incarnation, uint64_t connection, uint64_t number) {
    struct watched *w = &watch.stations[station];
    struct sent_frame *frame = &w->frames[number % FRAMES];
    if (number <= w->last_number)
        broken("a frame's number is above all before", "room-%d sends %llu after %llu", station + 1,
               (unsigned long long)number, (unsigned long long)w->last_number);
    w->last_number = number;
    w->sent++;
    *frame = (struct sent_frame){.number = number,
                                 .connection = connection,
                                 .incarnation = incarnation,
                                 .sent_ns = sim_now_ns()};
}

static void note_shown(struct watched *w, const arthron_View *view) {
    struct sent_frame *frame = &w->frames[w->last_number % FRAMES];
    if (frame->sent_ns != sim_now_ns())
        return; // this view's frame was not sent
    for (int i = 0; i < view->instruments_count; i++) {
        const arthron_ViewInstrument *v = &view->instruments[i];
        int at = (int)v->channel - CHANNEL_FIRST_INSTRUMENT;
        if (at < 0 || at >= INSTRUMENT_COUNT || !v->has_warped ||
            v->warp_validity != arthron_Validity_OK)
            continue;
        frame->shown[at] = true;
        frame->warped[at] = (vec3){v->warped.x, v->warped.y, v->warped.z};
    }
}

void watch_shown(int station, int64_t incarnation, const arthron_View *view) {
    struct watched *w = &watch.stations[station];
    watch.counts.views++;
    is_fair(station); // what is between two frames counts too
    int64_t ahead_ns = station_process(station)->ahead_ns;
    bool same_clock = w->view_incarnation == incarnation && w->shown_ahead_ns == ahead_ns;
    if (same_clock && view->time_ns < w->viewed_ns)
        broken("what is shown never goes back", "room-%d shows %lld ns after %lld", station + 1,
               (long long)view->time_ns, (long long)w->viewed_ns);
    w->viewed_ns = view->time_ns;
    w->view_incarnation = incarnation;
    w->shown_ahead_ns = ahead_ns;
    for (int bit = 0; bit < EVENT_COUNT; bit++)
        w->shown_events[bit] = view->events[bit];
    note_shown(w, view);
}

// ---- steps --------------------------------------------------------------------------------------

static struct sent_frame *find_frame(struct watched *w, uint64_t number) {
    struct sent_frame *frame = &w->frames[number % FRAMES];
    return frame->number == number ? frame : NULL;
}

// What was shown for this frame before its answer came, beside the answer.
static void compare_shown(int station, const struct sent_frame *frame,
                          const struct session_output *output) {
    if (!is_fair(station) || output->state != SESSION_RUNNING || output->landed.job)
        return;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct instrument_output *o = &output->instruments[i];
        if (!frame->shown[i] || !o->present || o->validity != VALIDITY_OK)
            continue;
        double off_mm = vec3_distance(frame->warped[i], o->T_mockup_warped.translation);
        watch.counts.error_mm = fmax(watch.counts.error_mm, off_mm);
        if (off_mm > SHOWN_OFF_MM)
            broken("while the network is fair, what is shown is near the answer",
                   "room-%d, frame %llu, instrument %d: %.3f mm off", station + 1,
                   (unsigned long long)frame->number, i, off_mm);
    }
}

static bool has_pose(const struct frame *frame) {
    for (int i = 0; i < frame->count; i++)
        if (frame->samples[i].kind == SAMPLE_POSE)
            return true;
    return false;
}

// One that is in order.
static void check_wait(int station, const struct sent_frame *frame) {
    int64_t took_ns = sim_now_ns() - frame->sent_ns;
    if (is_fair(station) && took_ns > WAIT_NS)
        broken("while all is fair no frame waits", "room-%d, frame %llu: %.3f ms", station + 1,
               (unsigned long long)frame->number, (double)took_ns / 1e6);
}

void __real_runtime_join(struct runtime *runtime, int station, struct control_peer peer, bool path);
void __wrap_runtime_join(struct runtime *runtime, int station, struct control_peer peer, bool path);
void __wrap_runtime_join(struct runtime *runtime, int station, struct control_peer peer,
                         bool path) {
    struct watched *w = &watch.stations[station];
    if (!sim_is_dead()) {
        memcpy(w->first_events, w->events, sizeof w->events);
        memcpy(w->first_shown, w->shown_events, sizeof w->shown_events);
    }
    __real_runtime_join(runtime, station, peer, path);
}

// A connection begins with what no reply had told before: once at most.
static void check_events(int station) {
    const struct watched *w = &watch.stations[station];
    for (int bit = 0; bit < EVENT_COUNT; bit++) {
        int32_t made = (int32_t)(w->events[bit] - w->first_events[bit]);
        int32_t shown = (int32_t)(w->shown_events[bit] - w->first_shown[bit]);
        if (shown < made - 1 || shown > made + 1)
            broken("every event is shown once", "room-%d, event %s: %d made, %d shown", station + 1,
                   event_name(bit), made, shown);
    }
}

static void watch_frame(int station, const struct session_input *input,
                        const struct session_output *output) {
    struct watched *w = &watch.stations[station];
    const struct sent_frame *frame = find_frame(w, input->frame.number);
    watch.counts.frames++;
    w->accepted++;
    if (!frame)
        broken("a step's frame was sent", "room-%d never sent frame %llu", station + 1,
               (unsigned long long)input->frame.number);
    check_wait(station, frame);
    if (has_pose(&input->frame) && frame->sent_ns < w->last_pose_ns)
        broken("poses never go back in a session", "room-%d: frame %llu is %.3f ms older",
               station + 1, (unsigned long long)frame->number,
               (double)(w->last_pose_ns - frame->sent_ns) / 1e6);
    if (has_pose(&input->frame))
        w->last_pose_ns = frame->sent_ns;
    compare_shown(station, frame, output);
}

bool __real_trace_append(struct trace_writer *writer, const struct session_input *input,
                         const struct session_output *output);
bool __wrap_trace_append(struct trace_writer *writer, const struct session_input *input,
                         const struct session_output *output);
bool __wrap_trace_append(struct trace_writer *writer, const struct session_input *input,
                         const struct session_output *output) {
    bool put = __real_trace_append(writer, input, output);
    if (sim_is_dead())
        return put;
    struct ledger *ledger = ledger_of(writer);
    int station = ledger_station(ledger);
    struct watched *w = &watch.stations[station];
    if (ledger_is_left(ledger))
        broken("a station has one session at a time", "room-%d steps in two", station + 1);
    if (w->session && w->session != ledger)
        ledger_leave(w->session);
    if (w->session != ledger)
        w->last_pose_ns = 0;
    w->session = ledger;
    w->time_ns = output->time_ns;
    watch.counts.steps++;
    report_hash(output->hash ^ (uint64_t)station);
    ledger_step(ledger, output, put);
    w->last_answerable = output->frame_number ? output->frame_number : w->last_answerable;
    if (input->kind == INPUT_FRAME)
        watch_frame(station, input, output);
    for (int bit = 0; bit < EVENT_COUNT; bit++)
        w->events[bit] += output->events >> bit & 1;
    return put;
}

// ---- replies ------------------------------------------------------------------------------------

static void check_reply(const arthron_Reply *reply) {
    for (int i = 0; i < watch.count; i++)
        if (watch.stations[i].last_answerable == reply->frame_number)
            return;
    broken("a reply leaves after its step was recorded", "frame %llu has no step",
           (unsigned long long)reply->frame_number);
}

bool __real_datagram_reply(struct datagram_endpoint *endpoint, uint32_t connection,
                           const arthron_Reply *reply);
bool __wrap_datagram_reply(struct datagram_endpoint *endpoint, uint32_t connection,
                           const arthron_Reply *reply);
bool __wrap_datagram_reply(struct datagram_endpoint *endpoint, uint32_t connection,
                           const arthron_Reply *reply) {
    if (!sim_is_dead())
        check_reply(reply);
    return __real_datagram_reply(endpoint, connection, reply);
}

bool __real_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message);
bool __wrap_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message);
bool __wrap_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message) {
    if (!sim_is_dead() && message->which_message == arthron_Control_reply_tag)
        check_reply(&message->message.reply);
    return __real_control_send(control, peer, message);
}

// ---- the instructor -----------------------------------------------------------------------------

uint64_t watch_session(int station) {
    const struct ledger *session = watch.stations[station].session;
    return session ? ledger_serial(session) : 0;
}

void watch_noted(int station, uint64_t session, const char *text) {
    if (session && session == watch_session(station)) {
        watch.counts.remarks++;
        ledger_note(watch.stations[station].session, text);
    }
}

void watch_some_session(int station, char out_id[256]) {
    ledger_some_id(station, out_id);
}

// ---- all is over --------------------------------------------------------------------------------

static void check_meshes(int station, struct link *link, struct sessions *sessions) {
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX];
    struct tissue_report report;
    runtime_tissues(sessions_runtime(sessions), station, &report);
    if (link_get_tissues(link, tissues) < 1 || tissues[0].hash != report.mesh_hashes[0])
        broken("a station has the mesh that the server has", "room-%d has another", station + 1);
}

struct watch_settled watch_settled(int station, struct link *link, struct sessions *sessions) {
    struct link_status status;
    struct station_status slot;
    struct watched *w = &watch.stations[station];
    const struct station_counts *c = runtime_counts(sessions_runtime(sessions), station);
    link_get_status(link, &status);
    sessions_status(sessions, station, &slot);
    if (!status.welcomed || status.path != LINK_DATAGRAM || slot.state != SESSION_RUNNING)
        broken("after the faults every station is served, by datagram",
               "room-%d: welcomed %d, path %d, state %d: %s", station + 1, status.welcomed,
               (int)status.path, (int)slot.state, status.refusal);
    if (atomic_load(&c->trace_failing))
        broken("after the faults every trace is written", "that of room-%d fails", station + 1);
    check_meshes(station, link, sessions);
    check_events(station);
    return (struct watch_settled){w->sent, w->accepted,
                                  atomic_load(&c->frames_lost) + atomic_load(&c->frames_late) +
                                      atomic_load(&c->frames_old) + atomic_load(&c->frames_early) +
                                      atomic_load(&c->frames_invalid) +
                                      atomic_load(&c->frames_excess),
                                  w->time_ns};
}
