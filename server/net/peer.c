#include "base/log.h"
#include "net/control_parts.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define FAST_PINGS 10
#define FAST_PING_NS (20 * NS_PER_MS)
#define PING_NS NS_PER_S
#define REST_PING_NS (20 * NS_PER_S)
#define REST_LOOK_NS (4 * NS_PER_S)
#define REST_HEARD_NS (10 * NS_PER_S)              // a station that rests says Ping within 8 s
#define UNANSWERED_NS (4 * NS_PER_S + PING_NS / 2) // the look at it comes with a ping
#define SILENCE_BESIDE_DATAGRAMS_NS (60 * NS_PER_S)
#define RECENT_NS (2 * NS_PER_S)
#define CLOSING_NS NS_PER_S
#define DAY_S INT64_C(86400)
#define ENROL_WAIT_NS (10 * NS_PER_S)
#define ASKS_PER_S 2 // for meshes
#define ASKS_BURST 32

static const char *const capabilities[] = {"datagrams",   "meshes", "path",
                                           "instruments", "force",  "markers"};

static void cancel_application(struct peer *peer) {
    if (peer->applies && peer->control->registrar) // none: the server has stopped
        registrar_withdraw(peer->control->registrar, peer);
    peer->applies = false;
}

// The session is told at once, however long the connection takes to close.
static void leave(struct peer *peer) {
    struct control_handler *handler = &peer->control->handler;
    if (!peer->agreed)
        return;
    peer->agreed = false;
    control_free_slot(peer);
    handler->on_gone(handler->user, peer->handle);
}

static void refuse_with(struct peer *peer, const arthron_Refusal *refusal) {
    const arthron_Control message = {.which_message = arthron_Control_refusal_tag,
                                     .message.refusal = *refusal};
    if (peer->identity.certified)
        log_info("control", "station %s is refused: %s", peer->identity.name, refusal->text);
    else
        log_debug("control", "an unknown client is refused: %s", refusal->text);
    cancel_application(peer);
    leave(peer);
    control_send_urgent(peer, &message, true);
}

void peer_refuse(struct peer *peer, arthron_Refusal_Reason reason, const char *format, ...) {
    arthron_Refusal refusal = {.reason = reason};
    va_list args;
    va_start(args, format);
    vsnprintf(refusal.text, sizeof refusal.text, format, args);
    va_end(args);
    refuse_with(peer, &refusal);
}

void peer_move(struct peer *peer, const char *server) {
    arthron_Control message = {.which_message = arthron_Control_moved_tag};
    snprintf(message.message.moved.server, sizeof message.message.moved.server, "%s", server);
    log_info("control", "station %s is sent to %s", peer->identity.name, server);
    leave(peer);
    control_send_urgent(peer, &message, true);
}

void peer_malformed(struct peer *peer, const char *text) {
    atomic_fetch_add(&peer->control->malformed_messages, 1);
    peer_refuse(peer, arthron_Refusal_Reason_MALFORMED, "%s", text);
}

static bool is_revoked(const struct peer *peer) {
    return registrar_is_revoked(peer->control->registrar, peer->identity.serial);
}

static void refuse_identity(struct peer *peer, const char *why) {
    atomic_fetch_add(&peer->control->refused_certificates, 1);
    peer_refuse(peer, arthron_Refusal_Reason_IDENTITY, "%s", why);
}

void peer_refuse_revoked(struct control *control) {
    for (int i = 0; i < control->slot_count; i++) {
        struct peer *peer = control->slots[i].peer; // of this thread
        if (peer && is_revoked(peer))
            refuse_identity(peer, "this certificate is revoked");
    }
}

void peer_opened(struct peer *peer) {
    struct control *control = peer->control;
    identity_of(lws_get_ssl(peer->wsi), &peer->identity);
    bool is_good = peer->identity.certified && !is_revoked(peer);
    peer->proved =
        is_good && door_prove(control->door, peer->wsi, peer->identity.serial, clock_now_ns());
    if (is_good && !peer->proved)
        peer_refuse(peer, arthron_Refusal_Reason_BUSY,
                    "this station connects too often, or too many stations are connected; try "
                    "again in a minute");
    if (is_good || peer->enrols)
        return;
    refuse_identity(peer, peer->identity.certified ? "this certificate is revoked"
                                                   : "a station needs a certificate: enrol first");
}

void peer_gone(struct peer *peer) {
    cancel_application(peer);
    leave(peer);
}

// ---- hello --------------------------------------------------------------------------------------

static bool has_capability(const arthron_Hello *hello, const char *capability) {
    for (int k = 0; k < hello->capabilities_count; k++)
        if (!strcmp(hello->capabilities[k], capability))
            return true;
    return false;
}

static void agree_capabilities(const arthron_Hello *hello, arthron_Welcome *welcome) {
    for (size_t i = 0; i < sizeof capabilities / sizeof *capabilities; i++)
        if (has_capability(hello, capabilities[i]))
            strcpy(welcome->capabilities[welcome->capabilities_count++], capabilities[i]);
}

static bool agree_version(const arthron_Hello *hello, uint32_t *out_version) {
    uint32_t newest = hello->version_max < WIRE_VERSION_MAX ? hello->version_max : WIRE_VERSION_MAX;
    uint32_t oldest = hello->version_min > WIRE_VERSION_MIN ? hello->version_min : WIRE_VERSION_MIN;
    *out_version = newest;
    return oldest <= newest;
}

// Everything that this room itself asks of a Hello.
static bool hello_is_good(struct peer *peer, const arthron_Hello *hello, uint32_t *out_version) {
    if (!agree_version(hello, out_version)) {
        peer_refuse(peer, arthron_Refusal_Reason_VERSION,
                    "the server speaks versions %d to %d, the station %u to %u", WIRE_VERSION_MIN,
                    WIRE_VERSION_MAX, hello->version_min, hello->version_max);
        return false;
    }
    if (strcmp(hello->station, peer->identity.name)) {
        peer_refuse(peer, arthron_Refusal_Reason_IDENTITY,
                    "Hello and certificate name different stations");
        return false;
    }
    registrar_used(peer->control->registrar, &peer->identity);
    peer->meshes = has_capability(hello, "meshes");
    peer->markers = has_capability(hello, "markers");
    if (!control_take_slot(peer)) {
        peer_refuse(peer, arthron_Refusal_Reason_BUSY, "%d stations are connected already",
                    peer->control->slot_count);
        return false;
    }
    return true;
}

// A station has one connection, and another to ask whether it would be welcome.
static void replace_older(struct peer *newer) {
    struct control *control = newer->control;
    for (int i = 0; i < control->slot_count; i++) {
        struct peer *peer = control->slots[i].peer; // of this thread
        if (peer && peer != newer && peer->visit == newer->visit &&
            !strcmp(peer->identity.name, newer->identity.name))
            peer_refuse(peer, arthron_Refusal_Reason_BUSY,
                        "a newer connection of this station has taken its place");
    }
}

static void handle_hello(struct peer *peer, const arthron_Hello *hello, int64_t now_ns) {
    struct control *control = peer->control;
    arthron_Control answer = {.which_message = arthron_Control_welcome_tag};
    arthron_Welcome *welcome = &answer.message.welcome;
    arthron_Refusal refusal = {0};
    uint32_t version;
    if (!hello_is_good(peer, hello, &version))
        return;
    enum result result =
        control->handler.on_hello(control->handler.user, peer->handle, hello, welcome, &refusal);
    if (result != RESULT_OK) {
        control_free_slot(peer);
        if (!refusal.text[0])
            snprintf(refusal.text, sizeof refusal.text, "%s", result_sentence(result));
        refuse_with(peer, &refusal);
        return;
    }
    welcome->version = version;
    welcome->utc_s = clock_utc_ns() / NS_PER_S;
    agree_capabilities(hello, welcome);
    snprintf(welcome->software, sizeof welcome->software, "%s", control->software);
    peer->agreed = true;
    peer->visit = hello->visit;
    peer->pong_ns = now_ns;
    door_keep(control->door, peer->wsi);
    replace_older(peer);
    control_send_urgent(peer, &answer, false);
    lws_set_timer_usecs(peer->wsi, 0);
}

// ---- enrolment ----------------------------------------------------------------------------------

static void handle_enrol(struct peer *peer, const arthron_Enrol *enrol, int64_t now_ns) {
    bool renews = peer->identity.certified && !enrol->code[0];
    if (renews && !peer->proved) {
        refuse_identity(peer, "this certificate is revoked");
        return;
    }
    if (!renews && !door_may_enrol(peer->control->door, peer->wsi, now_ns)) {
        peer_refuse(peer, arthron_Refusal_Reason_BUSY, "too many attempts, try again in a minute");
        return;
    }
    peer->applies = registrar_apply(peer->control->registrar, peer, &peer->identity, enrol);
    if (peer->applies)
        lws_set_timer_usecs(peer->wsi, ENROL_WAIT_NS / 1000);
    else
        peer_refuse(peer, arthron_Refusal_Reason_BUSY,
                    "%d stations are waiting to be enrolled; try again", REGISTRAR_APPLICANTS_MAX);
}

void peer_answered(struct peer *peer, const arthron_Control *answer) {
    const arthron_Refusal *refusal = &answer->message.refusal;
    peer->applies = false;
    if (answer->which_message == arthron_Control_refusal_tag)
        peer_refuse(peer, refusal->reason, "%s", refusal->text);
    else
        control_send_urgent(peer, answer, true);
}

// ---- clock --------------------------------------------------------------------------------------

static void send_ping(struct peer *peer) {
    arthron_Control message = {.which_message = arthron_Control_ping_tag};
    message.message.ping.sent_ns = peer->ping_ns = clock_now_ns();
    control_send_from_here(peer, &message);
    if (!peer->unanswered_ns)
        peer->unanswered_ns = peer->ping_ns;
    peer->pings++;
}

static void handle_ping(struct peer *peer, const arthron_Ping *ping, int64_t received_ns) {
    arthron_Control answer = {.which_message = arthron_Control_pong_tag};
    answer.message.pong = (arthron_Pong){ping->sent_ns, received_ns, clock_now_ns()};
    peer->their_ping_ns = received_ns;
    if (peer->says_rest && !ping->rests)
        peer->tick_ns = 0;
    peer->says_rest = ping->rests;
    control_send_from_here(peer, &answer);
}

static bool is_remote_time(int64_t time_ns) {
    return time_ns >= 0 && time_ns < WIRE_TIME_MAX_NS;
}

static void handle_pong(struct peer *peer, const arthron_Pong *pong, int64_t received_ns) {
    int64_t offset_ns, uncertainty_ns;
    peer->pong_ns = received_ns;
    peer->unanswered_ns = 0;
    if (pong->sent_ns < 0 || pong->sent_ns > received_ns || !is_remote_time(pong->received_ns) ||
        !is_remote_time(pong->answered_ns) ||
        !clock_offset_add(&peer->clock, pong->sent_ns, pong->received_ns, pong->answered_ns,
                          received_ns) ||
        !clock_offset_get(&peer->clock, received_ns, &offset_ns, &uncertainty_ns))
        return;
    struct control_handler *handler = &peer->control->handler;
    handler->on_clock(handler->user, peer->handle, -offset_ns, uncertainty_ns,
                      clock_offset_round_trip_ns(&peer->clock));
}

// ---- messages -----------------------------------------------------------------------------------

static void handle_first(struct peer *peer, const arthron_Control *message, int64_t now_ns) {
    if (peer->enrols && !peer->applies && message->which_message == arthron_Control_enrol_tag)
        handle_enrol(peer, &message->message.enrol, now_ns);
    else if (!peer->enrols && message->which_message == arthron_Control_hello_tag)
        handle_hello(peer, &message->message.hello, now_ns);
    else
        peer_malformed(peer, peer->enrols ? "the only message allowed here is one Enrol"
                                          : "the first message must be Hello");
}

static void pass_on(struct peer *peer, const arthron_Control *message) {
    struct control_handler *handler = &peer->control->handler;
    handler->on_message(handler->user, peer->handle, message);
}

// Whoever asks for meshes too often waits. The last ask counts.
static void handle_ask(struct peer *peer, const arthron_Control *message, int64_t now_ns) {
    if (!peer->asks_late && bucket_take(&peer->asks, ASKS_PER_S, ASKS_BURST, now_ns)) {
        pass_on(peer, message);
        return;
    }
    if (!peer->asks_late)
        log_warning("control", "station %s asks for its meshes too often, so it waits for them",
                    peer->identity.name);
    control_tell_slowed(peer, true);
    peer->asks_late = true;
    peer->late_ask = message->message.mesh_ask;
}

static void pass_on_late_ask(struct peer *peer, int64_t now_ns) {
    arthron_Control message = {.which_message = arthron_Control_mesh_ask_tag};
    if (!peer->asks_late || !bucket_take(&peer->asks, ASKS_PER_S, ASKS_BURST, now_ns))
        return;
    peer->asks_late = false;
    message.message.mesh_ask = peer->late_ask;
    pass_on(peer, &message);
}

static void handle_mesh(struct peer *peer, const arthron_Control *message, int64_t now_ns) {
    if (!peer->meshes)
        peer_malformed(peer, "this message needs the capability meshes");
    else if (message->which_message == arthron_Control_mesh_ask_tag)
        handle_ask(peer, message, now_ns);
    else
        pass_on(peer, message);
}

static void handle_marker(struct peer *peer, const arthron_Control *message) {
    if (peer->markers)
        pass_on(peer, message);
    else
        peer_malformed(peer, "this message needs the capability markers");
}

static void handle_message(struct peer *peer, const arthron_Control *message, int64_t now_ns) {
    struct control_handler *handler = &peer->control->handler;
    switch (message->which_message) {
    case arthron_Control_ping_tag:
        handle_ping(peer, &message->message.ping, now_ns);
        break;
    case arthron_Control_pong_tag:
        handle_pong(peer, &message->message.pong, now_ns);
        break;
    case arthron_Control_frame_tag:
        peer->frame_ns = now_ns;
        handler->on_frame(handler->user, peer->handle, &message->message.frame, now_ns);
        break;
    case arthron_Control_udp_path_tag:
        pass_on(peer, message);
        break;
    case arthron_Control_mesh_ask_tag:
    case arthron_Control_mesh_ack_tag:
        handle_mesh(peer, message, now_ns);
        break;
    case arthron_Control_marker_tag:
        handle_marker(peer, message);
        break;
    default:
        peer_malformed(peer, "a station may not send this message now");
    }
}

void peer_receive(struct peer *peer, int64_t now_ns) {
    struct control *control = peer->control;
    struct error err = {0};
    if (wire_decode_control(peer->incoming, peer->used, &control->message, &err) != RESULT_OK)
        peer_malformed(peer, err.text);
    else if (control->message.which_message == 0)
        atomic_fetch_add(&control->unknown_messages, 1);
    else if (peer->agreed)
        handle_message(peer, &control->message, now_ns);
    else
        handle_first(peer, &control->message, now_ns);
}

// At the start and then once a day. A station renews its certificate by itself long before.
static void warn_of_certificate(struct peer *peer) {
    int64_t now_s = clock_utc_ns() / NS_PER_S, left_s = peer->identity.until_s - now_s;
    if (left_s >= TLS_WARNING_DAYS * DAY_S || now_s - peer->warned_s < DAY_S)
        return;
    peer->warned_s = now_s;
    log_warning("control", "station %s: its certificate ends in %d days; enrol it again",
                peer->identity.name, (int)(left_s / DAY_S));
}

static bool is_recent(int64_t time_ns, int64_t now_ns) {
    return now_ns - time_ns < RECENT_NS;
}

static bool has_datagrams(const struct peer *peer, int64_t now_ns) {
    const struct control_handler *handler = &peer->control->handler;
    return handler->datagram_ns &&
           is_recent(handler->datagram_ns(handler->user, peer->handle), now_ns);
}

static bool rests(const struct peer *peer, int64_t now_ns) {
    return peer->says_rest && now_ns - peer->their_ping_ns < REST_HEARD_NS &&
           peer->frame_ns < peer->their_ping_ns && !has_datagrams(peer, now_ns);
}

// When the next one may be due. After a rest the clock is asked for as at the beginning: it has
// drifted.
static int64_t ping_if_due(struct peer *peer, int64_t now_ns) {
    int64_t since_ns = now_ns - peer->ping_ns;
    bool is_at_rest = rests(peer, now_ns);
    if (!is_at_rest && since_ns > REST_LOOK_NS + PING_NS)
        peer->pings = 0;
    if (peer->pings < FAST_PINGS || !is_at_rest || since_ns > REST_PING_NS - PING_NS / 2)
        send_ping(peer);
    if (peer->pings < FAST_PINGS)
        return FAST_PING_NS;
    return is_at_rest && !peer->unanswered_ns && !peer->asks_late ? REST_LOOK_NS : PING_NS;
}

// While the station's frames come by datagram, its session lives without this connection for a
// while.
static bool is_silent(const struct peer *peer, int64_t now_ns) {
    if (!peer->unanswered_ns || now_ns - peer->unanswered_ns <= UNANSWERED_NS)
        return false;
    return !has_datagrams(peer, now_ns) || now_ns - peer->pong_ns > SILENCE_BESIDE_DATAGRAMS_NS;
}

bool peer_tick(struct peer *peer, int64_t now_ns, int64_t *out_next_us) {
    *out_next_us = CLOSING_NS / 1000;
    if (peer->closing)
        return false; // it did not take its last message in time
    if (peer->applies) {
        peer_refuse(peer, arthron_Refusal_Reason_BUSY,
                    "the server's keys are in use, try again with the same code");
        return true;
    }
    if (!peer->agreed) {
        peer_refuse(peer, arthron_Refusal_Reason_MALFORMED, "no %s in time",
                    peer->enrols ? "Enrol" : "Hello");
        return true;
    }
    if (is_silent(peer, now_ns)) {
        log_warning("control", "station %s: no answer for %d s, its connection is closed",
                    peer->identity.name, (int)((now_ns - peer->pong_ns) / NS_PER_S));
        return false;
    }
    if (is_revoked(peer)) {
        refuse_identity(peer, "this certificate is revoked");
        return true;
    }
    pass_on_late_ask(peer, now_ns);
    warn_of_certificate(peer);
    *out_next_us = ping_if_due(peer, now_ns) / 1000;
    return true;
}
