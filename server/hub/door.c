// Who comes in over the control connection, and which seat is whose. Everything here runs in the
// control thread and only leaves notes for workers, theatres and the clerk.
#include "base/clock.h"
#include "base/log.h"
#include "hub/grades.h"
#include "hub/seat.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

// Who is connected is written by this thread alone, so it reads it without the lock: a frame that
// comes over TCP waits for no theatre that has the lock and no processor.
static int find_seat(const struct hub *hub, struct control_peer peer) {
    for (int i = 0; i < hub->config.station_count; i++) {
        const struct card *card = &hub->seats[i].card;
        if (card->connected && card->peer.index == peer.index &&
            card->peer.generation == peer.generation)
            return i;
    }
    return -1;
}

static bool tell(struct hub *hub, const struct note *note) {
    struct worker *worker = seat_worker(hub, note->seat);
    return worker_tell(worker, worker->from_control, note);
}

// ---- hello --------------------------------------------------------------------------------------

__attribute__((format(printf, 3, 4))) static enum result
refuse(arthron_Refusal *refusal, arthron_Refusal_Reason reason, const char *format, ...) {
    va_list args;
    va_start(args, format);
    vsnprintf(refusal->text, sizeof refusal->text, format, args);
    va_end(args);
    refusal->reason = reason;
    log_warning("hub", "%s", refusal->text);
    return RESULT_REFUSED;
}

static void fill_welcome(struct hub *hub, const struct seat *seat, bool resumed,
                         arthron_Welcome *welcome) {
    const struct knee_case *knee = scene_case(hub->scenes[seat->card.scene]);
    memcpy(welcome->session_id, seat->card.session_id, sizeof welcome->session_id);
    snprintf(welcome->case_name, sizeof welcome->case_name, "%s", knee->name);
    welcome->case_hash = knee->hash;
    welcome->state = (arthron_SessionState)atomic_load(&seat->counts.state);
    welcome->resumed = resumed;
    welcome->hold_ms = (uint32_t)(hub->config.settings.hold_ns / NS_PER_MS);
}

// card_lock held.
static void take_seat(struct hub *hub, int index, struct control_peer peer, uint64_t connection,
                      arthron_Welcome *welcome) {
    struct seat *seat = &hub->seats[index];
    bool resumed = seat_has_session(seat);
    seat->card.connected = true;
    seat->card.peer = peer;
    seat->card.connection = connection;
    seat->card.stopped = false;
    seat->card.retry_ns = 0;
    if (!resumed) {
        desk_new_id(seat->card.session_id);
        seat->card.id_is_fresh = true;
        desk_call(hub);
    }
    fill_welcome(hub, seat, resumed, welcome);
}

static void leave_seat(struct hub *hub, int index) {
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[index].card.connected = false;
    pthread_mutex_unlock(&hub->card_lock);
}

// card_lock held.
static void keep_hello(struct card *card, const arthron_Hello *hello) {
    card->calibrated = hello->has_calibration;
    card->calibration = hello->calibration;
    card->device_count = hello->devices_count;
    memcpy(card->devices, hello->devices, sizeof card->devices);
}

static void warn_of_calibration(const struct hub *hub, const arthron_Hello *hello) {
    char problem[128] = "";
    if (hello->has_calibration)
        calibration_judge(&hello->calibration, &hub->config, clock_utc_ns() / NS_PER_S, problem,
                          sizeof problem);
    if (problem[0])
        log_warning("hub", "station %s: %s", hello->station, problem);
}

// A station that only asks whether it would be welcome.
static enum result receive_visit(struct hub *hub, int index, arthron_Welcome *welcome) {
    pthread_mutex_lock(&hub->card_lock);
    fill_welcome(hub, &hub->seats[index], false, welcome);
    pthread_mutex_unlock(&hub->card_lock);
    log_info("hub", "station %s tests its connection", hub->seats[index].station->name);
    return RESULT_OK;
}

static enum result allow_case(struct hub *hub, int index, struct error *err) {
    pthread_mutex_lock(&hub->card_lock);
    int scene = hub->seats[index].card.scene;
    pthread_mutex_unlock(&hub->card_lock);
    return grades_allow(hub->grades, scene, err);
}

static enum result on_hello(void *user, struct control_peer peer, const arthron_Hello *hello,
                            arthron_Welcome *welcome, arthron_Refusal *refusal) {
    struct hub *hub = user;
    int index = hub_find_station(&hub->config, hello->station);
    if (index < 0)
        return refuse(refusal, arthron_Refusal_Reason_NO_CASE,
                      "station %s has no case: the server's config does not name it",
                      hello->station);
    struct error unfit;
    if (allow_case(hub, index, &unfit) != RESULT_OK)
        return refuse(refusal, arthron_Refusal_Reason_NO_CASE, "station %s: %s", hello->station,
                      unfit.text);
    if (hello->visit)
        return receive_visit(hub, index, welcome);
    pthread_mutex_lock(&hub->card_lock);
    struct card *card = &hub->seats[index].card;
    bool rival = card->connected && card->connection != hello->connection;
    if (!rival) {
        take_seat(hub, index, peer, hello->connection, welcome);
        keep_hello(card, hello);
    }
    pthread_mutex_unlock(&hub->card_lock);
    if (rival)
        return refuse(refusal, arthron_Refusal_Reason_BUSY,
                      "station %s is connected already, from another place", hello->station);
    struct note note = {.kind = NOTE_JOINED, .seat = index, .peer = peer};
    if (!tell(hub, &note)) {
        leave_seat(hub, index);
        return refuse(refusal, arthron_Refusal_Reason_BUSY, "station %s: the server is too busy",
                      hello->station);
    }
    warn_of_calibration(hub, hello);
    log_info("hub", "station %s joined%s", hello->station, welcome->resumed ? " again" : "");
    return RESULT_OK;
}

// ---- after hello --------------------------------------------------------------------------------

static void on_clock(void *user, struct control_peer peer, int64_t offset_ns,
                     int64_t uncertainty_ns, int64_t rtt_ns) {
    struct hub *hub = user;
    int index = find_seat(hub, peer);
    if (index < 0)
        return;
    atomic_store(&hub->seats[index].counts.rtt_ns, rtt_ns);
    atomic_store(&hub->seats[index].counts.clock_uncertainty_ns, uncertainty_ns);
    struct note note = {
        .kind = NOTE_CLOCK, .seat = index, .peer = peer, .clock_offset_ns = offset_ns};
    tell(hub, &note);
}

static void on_frame(void *user, struct control_peer peer, const arthron_Frame *message,
                     int64_t received_ns) {
    struct hub *hub = user;
    int index = find_seat(hub, peer);
    if (index < 0)
        return;
    struct note note = {
        .kind = NOTE_FRAME, .seat = index, .peer = peer, .received_ns = received_ns};
    if (wire_frame_to(message, &note.frame, NULL) != RESULT_OK || !tell(hub, &note))
        atomic_fetch_add(&hub->seats[index].counts.frames_invalid, 1);
}

static void on_message(void *user, struct control_peer peer, const arthron_Control *message) {
    struct hub *hub = user;
    int index = find_seat(hub, peer);
    if (index < 0)
        return;
    if (message->which_message == arthron_Control_mesh_ask_tag ||
        message->which_message == arthron_Control_mesh_ack_tag)
        theatre_tell(seat_worker(hub, index)->theatre, index, peer, message);
    if (message->which_message != arthron_Control_udp_path_tag)
        return;
    struct note note = {.kind = NOTE_CONFIRM,
                        .seat = index,
                        .peer = peer,
                        .challenge = message->message.udp_path.challenge};
    tell(hub, &note);
}

static void on_gone(void *user, struct control_peer peer) {
    struct hub *hub = user;
    int index = find_seat(hub, peer);
    if (index < 0)
        return;
    leave_seat(hub, index);
    log_info("hub", "station %s disconnected; its session waits", hub->seats[index].station->name);
    theatre_tell(seat_worker(hub, index)->theatre, index, peer, NULL);
    struct note note = {.kind = NOTE_GONE, .seat = index, .peer = peer};
    if (!tell(hub, &note))
        log_error("hub", "station %s: its worker could not be told that it is gone",
                  hub->seats[index].station->name);
}

struct control_handler door_handler(struct hub *hub) {
    return (struct control_handler){
        .user = hub,
        .on_hello = on_hello,
        .on_clock = on_clock,
        .on_frame = on_frame,
        .on_message = on_message,
        .on_gone = on_gone,
    };
}
