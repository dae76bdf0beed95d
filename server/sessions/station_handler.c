#include "sessions/station_handler.h"

#include "base/clock.h"
#include "base/log.h"
#include "sessions/calibration.h"
#include "sessions/manager.h"
#include "sessions/moving.h"
#include "sessions/resources.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

// The control thread alone writes who is connected, so what it reads does not change under it.
static int find_station(struct sessions *s, struct control_peer peer) {
    int station = s->station_of[peer.index];
    return station_slot_is_of(&s->slots[station], peer) ? station : -1;
}

// ---- hello --------------------------------------------------------------------------------------

__attribute__((format(printf, 3, 4))) static enum result
refuse(arthron_Refusal *refusal, arthron_Refusal_Reason reason, const char *format, ...) {
    va_list args;
    va_start(args, format);
    vsnprintf(refusal->text, sizeof refusal->text, format, args);
    va_end(args);
    refusal->reason = reason;
    log_warning("sessions", "%s", refusal->text);
    return RESULT_REFUSED;
}

// So that instructors see why it does not train.
static enum result refuse_station(struct sessions *s, int station, arthron_Refusal *refusal,
                                  arthron_Refusal_Reason reason, const struct error *why) {
    station_slot_refused(&s->slots[station], why->text);
    return refuse(refusal, reason, "station %s: %s", station_name(s, station), why->text);
}

static void fill_welcome(struct sessions *s, const struct station_status *status, bool resumed,
                         arthron_Welcome *welcome) {
    const struct knee_case *knee = scene_case(s->scenes[status->scene]);
    memcpy(welcome->session_id, status->session_id, sizeof welcome->session_id);
    snprintf(welcome->case_name, sizeof welcome->case_name, "%s", knee->name);
    welcome->case_hash = knee->hash;
    welcome->state = (arthron_SessionState)status->state;
    welcome->resumed = resumed;
    welcome->hold_ms = (uint32_t)(s->config.settings.hold_ns / NS_PER_MS);
}

static void warn_of_calibration(const struct sessions *s, const arthron_Hello *hello) {
    char problem[128] = "";
    if (hello->has_calibration)
        calibration_judge(&hello->calibration, &s->config, clock_utc_ns() / NS_PER_S, problem,
                          sizeof problem);
    if (problem[0])
        log_warning("sessions", "station %s: %s", hello->station, problem);
}

static enum result allow_case(struct sessions *s, int station, struct error *err) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    return grades_allow(s->grades, status.scene, err);
}

// A station that only asks whether it would be welcome.
static enum result receive_visit(struct sessions *s, int station, arthron_Welcome *welcome) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    fill_welcome(s, &status, false, welcome);
    log_info("sessions", "station %s tests its connection", station_name(s, station));
    return RESULT_OK;
}

// A station that has a session comes back to it whatever is left.
static enum result allow_session(struct sessions *s, int station, struct error *err) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    return status.phase == SLOT_EMPTY ? resources_allow_session(err) : RESULT_OK;
}

static bool names_path(const arthron_Hello *hello) {
    for (int i = 0; i < hello->capabilities_count; i++)
        if (!strcmp(hello->capabilities[i], "path"))
            return true;
    return false;
}

// The claim comes before Welcome, so that Welcome has the id of the session that is opened. An
// opening that the station finds under way was begun for another connection of its own.
static enum result receive(struct sessions *s, int station, struct control_peer peer,
                           const arthron_Hello *hello, arthron_Welcome *welcome,
                           arthron_Refusal *refusal) {
    struct station_slot *slot = &s->slots[station];
    struct station_status status;
    if (!station_slot_join(slot, peer, hello, &status))
        return refuse(refusal, arthron_Refusal_Reason_BUSY,
                      "station %s is connected already, from another place", hello->station);
    s->station_of[peer.index] = station;
    bool resumed = status.phase == SLOT_ATTACHED || status.phase == SLOT_ENDING;
    manager_open(s, station);
    station_slot_status(slot, &status);
    fill_welcome(s, &status, resumed, welcome);
    runtime_join(s->runtime, station, peer, names_path(hello));
    manager_call(s, station); // the session may be of other instruments
    warn_of_calibration(s, hello);
    log_info("sessions", "station %s joined%s", hello->station, resumed ? " again" : "");
    return RESULT_OK;
}

static enum result on_hello(void *user, struct control_peer peer, const arthron_Hello *hello,
                            arthron_Welcome *welcome, arthron_Refusal *refusal) {
    struct sessions *s = user;
    struct error why;
    int station = sessions_find_station(&s->config, hello->station);
    if (station < 0)
        return refuse(refusal, arthron_Refusal_Reason_NO_CASE,
                      "station %s has no case: the server's config does not name it",
                      hello->station);
    if (allow_case(s, station, &why) != RESULT_OK)
        return refuse_station(s, station, refusal, arthron_Refusal_Reason_NO_CASE, &why);
    if (hello->visit)
        return receive_visit(s, station, welcome);
    if (!moving_hello(s, station, refusal, &welcome->token))
        return RESULT_REFUSED;
    if (allow_session(s, station, &why) != RESULT_OK)
        return refuse_station(s, station, refusal, arthron_Refusal_Reason_BUSY, &why);
    return receive(s, station, peer, hello, welcome, refusal);
}

// ---- after hello --------------------------------------------------------------------------------

static void on_clock(void *user, struct control_peer peer, int64_t offset_ns,
                     int64_t uncertainty_ns, int64_t rtt_ns) {
    struct sessions *s = user;
    int station = find_station(s, peer);
    if (station < 0)
        return;
    station_slot_set_clock(&s->slots[station], rtt_ns, uncertainty_ns);
    runtime_set_clock(s->runtime, station, offset_ns);
}

static void on_frame(void *user, struct control_peer peer, const arthron_Frame *message,
                     int64_t received_ns) {
    struct sessions *s = user;
    int station = find_station(s, peer);
    struct frame frame;
    if (station < 0)
        return;
    if (wire_frame_to(message, &frame, NULL) == RESULT_OK)
        runtime_frame(s->runtime, station, &frame, received_ns);
    else
        runtime_count_invalid_frame(s->runtime, station);
}

static void receive_marker(struct sessions *s, int station, const arthron_Marker *message) {
    struct marker marker;
    struct station_status status;
    if (wire_marker_to(message, &marker, NULL) != RESULT_OK)
        return;
    station_slot_status(&s->slots[station], &status);
    marker.run = status.connection;
    runtime_marker(s->runtime, station, &marker);
}

static void on_message(void *user, struct control_peer peer, const arthron_Control *message) {
    struct sessions *s = user;
    int station = find_station(s, peer);
    if (station < 0)
        return;
    if (message->which_message == arthron_Control_udp_path_tag)
        runtime_confirm_path(s->runtime, station, message->message.udp_path.challenge);
    else if (message->which_message == arthron_Control_mesh_ask_tag ||
             message->which_message == arthron_Control_mesh_ack_tag)
        runtime_mesh_message(s->runtime, station, peer, message);
    else if (message->which_message == arthron_Control_marker_tag)
        receive_marker(s, station, &message->message.marker);
}

static void on_gone(void *user, struct control_peer peer) {
    struct sessions *s = user;
    int station = find_station(s, peer);
    if (station < 0)
        return;
    station_slot_leave(&s->slots[station]);
    runtime_leave(s->runtime, station);
    log_info("sessions", "station %s disconnected; its session waits", station_name(s, station));
}

static void on_slowed(void *user, struct control_peer peer, bool asks) {
    struct sessions *s = user;
    int station = find_station(s, peer);
    if (station >= 0)
        runtime_slowed(s->runtime, station, asks ? SLOWED_ASKS : SLOWED_MESSAGES);
}

static int64_t datagram_ns(void *user, struct control_peer peer) {
    struct sessions *s = user;
    int station = find_station(s, peer);
    return station < 0 ? 0 : atomic_load(&runtime_counts(s->runtime, station)->datagram_ns);
}

struct control_handler station_handler(struct sessions *s) {
    return (struct control_handler){
        .user = s,
        .on_hello = on_hello,
        .on_clock = on_clock,
        .on_frame = on_frame,
        .on_message = on_message,
        .on_gone = on_gone,
        .on_slowed = on_slowed,
        .datagram_ns = datagram_ns,
    };
}
