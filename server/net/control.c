#include "net/control.h"

#include "base/check.h"
#include "base/log.h"
#include "net/control_parts.h"

#include <errno.h>
#include <inttypes.h>
#include <openssl/ssl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define HANDSHAKE_S 3
#define SPARE_FDS 8 // the listening socket, the one that wakes
#define SAID_NS (10 * NS_PER_S)
#define MESSAGES_PER_S 4000 // of one peer; a station sends 2000 frames at most
#define MESSAGES_BURST 2000
#define ROUND_US (100 * LWS_US_PER_MS)
#define SLOWED_US (50 * LWS_US_PER_MS)

// ---- the control thread -------------------------------------------------------------------------

static void serve(struct control *control, const struct peer_slot *slot) {
    struct peer *peer = slot->peer;
    if (ws_server_stops(control->server))
        peer_refuse(peer, arthron_Refusal_Reason_SHUTDOWN, "the server stops");
    else if (slot->overflown)
        control_end_soon(peer);
    else if (slot->server[0])
        peer_move(peer, slot->server);
    else
        lws_callback_on_writable(peer->wsi);
}

static void hand_out_answers(struct control *control) {
    struct peer *applicant;
    arthron_Control answer;
    while (registrar_next_answer(control->registrar, &applicant, &answer))
        peer_answered(applicant, &answer);
}

static void take_certificate(struct control *control) {
    struct tls_credentials *credentials = registrar_take_credentials(control->registrar);
    if (credentials)
        tls_credentials_use(credentials, control->tls);
    tls_credentials_destroy(&credentials);
}

static void take_woken(struct control *control, bool all) {
    pthread_mutex_lock(&control->lock);
    for (int i = 0; all && i < control->slot_count; i++)
        control_wake_slot(control, &control->slots[i]);
    int *empty = control->serving;
    control->serving = control->woken;
    control->serving_count = control->woken_count;
    control->woken = empty;
    control->woken_count = 0;
    for (int i = 0; i < control->serving_count; i++)
        control->slots[control->serving[i]].wakes = false;
    pthread_mutex_unlock(&control->lock);
}

static void serve_slots(struct control *control, bool all) {
    take_woken(control, all);
    for (int i = 0; i < control->serving_count; i++) {
        pthread_mutex_lock(&control->lock);
        struct peer_slot slot = control->slots[control->serving[i]];
        pthread_mutex_unlock(&control->lock);
        if (slot.peer)
            serve(control, &slot);
    }
}

static void on_control_wake(void *user) {
    struct control *control = user;
    if (registrar_take_revoked(control->registrar))
        peer_refuse_revoked(control);
    serve_slots(control, false);
    hand_out_answers(control);
    take_certificate(control);
}

static void on_stop(void *user) {
    serve_slots(user, true);
}

static bool is_empty(void *user) {
    return ((const struct control *)user)->connections == 0;
}

// ---- connections --------------------------------------------------------------------------------

static void shut_connection(void *connection) {
    shutdown(lws_get_socket_fd(connection), SHUT_RDWR); // it then ends like one that the peer ended
}

static void tell_of_shut(struct control *control, int64_t now_ns) {
    struct source source;
    char text[SOURCE_TEXT_SIZE];
    if (control->shut_said_ns && now_ns - control->shut_said_ns < SAID_NS)
        return;
    uint64_t count = door_take_shut(control->door, &source);
    if (!count)
        return;
    control->shut_said_ns = now_ns;
    atomic_fetch_add(&control->shut, count);
    source_write(&source, text);
    log_warning("control",
                "too many connections, most of them without a certificate: %" PRIu64
                " were closed, the last one from %s",
                count, text);
}

static int let_in(struct control *control, int fd) {
    int64_t now_ns = clock_now_ns();
    struct source source;
    bool may = !ws_server_stops(control->server) && source_of(fd, &source) &&
               door_let_in(control->door, &source, now_ns);
    tell_of_shut(control, now_ns);
    return may ? 0 : -1;
}

static int open_peer(struct control *control, struct peer *peer, struct lws *wsi, bool enrols) {
    if (ws_server_stops(control->server))
        return -1;
    peer->control = control;
    peer->wsi = wsi;
    peer->enrols = enrols;
    control->connections++;
    ws_keep_queue_short(wsi);
    lws_set_timer_usecs(wsi, control->hello_timeout_ns / 1000);
    peer_opened(peer);
    return 0;
}

static int close_peer(struct peer *peer) {
    if (!peer->control)
        return 0;
    peer->control->connections--;
    peer_gone(peer);
    return 0;
}

void control_tell_slowed(struct peer *peer, bool asks) {
    const struct control_handler *handler = &peer->control->handler;
    if (handler->on_slowed)
        handler->on_slowed(handler->user, peer->handle, asks);
}

// What comes too fast waits in the network: nothing is lost, and the sender slows down.
// libwebsockets would never return if it were told so while it hands out what it has read.
static void slow_down(struct peer *peer, int64_t now_ns) {
    if (!peer->agreed || peer->closing || peer->slows ||
        bucket_take(&peer->messages, MESSAGES_PER_S, MESSAGES_BURST, now_ns))
        return;
    if (!peer->slow_said_ns || now_ns - peer->slow_said_ns > SAID_NS)
        log_warning("control", "station %s sends more than %d messages a second: it is slowed down",
                    peer->identity.name, MESSAGES_PER_S);
    peer->slow_said_ns = now_ns;
    peer->slows = true;
    control_tell_slowed(peer, false);
    lws_set_timer_usecs(peer->wsi, 1);
}

// Between two reads. True if nothing is read until the next call.
static bool pause_reading(struct peer *peer) {
    bool pauses = peer->slows && !peer->closing;
    if (pauses || peer->slowed)
        lws_rx_flow_control(peer->wsi, !pauses);
    peer->slowed = pauses;
    peer->slows = false;
    if (pauses)
        lws_set_timer_usecs(peer->wsi, SLOWED_US);
    return pauses;
}

static int receive_message(struct peer *peer, const void *bytes, size_t size) {
    int64_t now_ns = clock_now_ns();
    if (peer->closing)
        return 0;
    if (size > sizeof peer->incoming - peer->used || !lws_frame_is_binary(peer->wsi)) {
        peer_malformed(peer, "messages must be binary and at most 8192 bytes");
        return 0;
    }
    memcpy(peer->incoming + peer->used, bytes, size);
    peer->used += size;
    if (lws_remaining_packet_payload(peer->wsi) || !lws_is_final_fragment(peer->wsi))
        return 0;
    peer_receive(peer, now_ns);
    peer->used = 0;
    slow_down(peer, now_ns);
    return 0;
}

static int write_message(struct peer *peer, uint8_t *bytes, size_t size) {
    if (lws_write(peer->wsi, bytes, size, LWS_WRITE_BINARY) < (int)size)
        return -1;
    if (control_has_more(peer))
        lws_callback_on_writable(peer->wsi);
    return 0;
}

static int write_next(struct peer *peer) {
    struct outgoing out;
    if (peer->left)
        return 0;
    if (peer->done) {
        peer->left = true;
        return ws_close(peer->wsi, LWS_CLOSE_STATUS_POLICY_VIOLATION);
    }
    if (control_next_message(peer, &out)) {
        peer->done = out.last;
        return write_message(peer, out.bytes, out.size);
    }
    size_t size = peer->agreed && !peer->closing ? control_next_chunk(peer) : 0;
    return size ? write_message(peer, peer->control->chunk_bytes.bytes, size) : 0;
}

static int tick(struct peer *peer) {
    int64_t now_ns = clock_now_ns(), next_us;
    if (pause_reading(peer) || (peer->agreed && !peer->closing && now_ns < peer->tick_ns))
        return 0;
    if (!peer_tick(peer, now_ns, &next_us))
        return ws_end(peer->wsi);
    if (peer->closing && !peer->urgent.size) // its ping could not be written
        return ws_end(peer->wsi);
    peer->tick_ns = now_ns + 1000 * next_us;
    if (!peer->agreed || next_us < ROUND_US)
        lws_set_timer_usecs(peer->wsi, next_us);
    return 0;
}

// Ticks of agreed peers come together, in few turns of the thread. Each with a timer of its own
// would cost more, the more peers there are: libwebsockets keeps timers in a sorted list.
static void on_round(lws_sorted_usec_list_t *round) {
    struct control *control = lws_container_of(round, struct control, round);
    int64_t now_ns = clock_now_ns();
    atomic_store(&control->round_ns, now_ns);
    for (int i = 0; i < control->slot_count; i++) {
        struct peer *peer = control->slots[i].peer;
        if (peer && !peer->closing && !peer->slows && !peer->slowed && peer->tick_ns <= now_ns)
            lws_set_timer_usecs(peer->wsi, 1);
    }
    lws_sul_schedule(ws_server_context(control->server), 0, round, on_round, ROUND_US);
}

static int on_peer(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *bytes,
                   size_t size) {
    struct control *control = lws_context_user(lws_get_context(wsi));
    switch (reason) {
    case LWS_CALLBACK_ESTABLISHED:
        return open_peer(control, user, wsi,
                         !strcmp(lws_get_protocol(wsi)->name, WIRE_ENROL_SUBPROTOCOL));
    case LWS_CALLBACK_RECEIVE:
        return receive_message(user, bytes, size);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return write_next(user);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
        return ws_closed(wsi, ((struct peer *)user)->left);
    case LWS_CALLBACK_TIMER:
        return tick(user);
    case LWS_CALLBACK_CLOSED:
        return close_peer(user);
    default:
        return 0;
    }
}

// What is no WebSocket, or names no subprotocol of ours, and what concerns the whole server.
static int on_control_other(struct lws *wsi, enum lws_callback_reasons reason, void *user,
                            void *bytes, size_t size) {
    (void)size;
    struct control *control = lws_context_user(lws_get_context(wsi));
    switch (reason) {
    case LWS_CALLBACK_OPENSSL_LOAD_EXTRA_SERVER_VERIFY_CERTS:
        control->tls = user;
        identity_ask(user, &control->refused_certificates);
        return 0;
    case LWS_CALLBACK_FILTER_NETWORK_CONNECTION:
        return let_in(control, (int)(intptr_t)bytes);
    case LWS_CALLBACK_WSI_CREATE:
        door_open(control->door, wsi, clock_now_ns());
        return 0;
    case LWS_CALLBACK_WSI_DESTROY:
        door_close(control->door, wsi);
        return 0;
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE: // else to HTTP/2, and nobody would time it out
        return strcasecmp(bytes, "websocket") ? -1 : 0;
    case LWS_CALLBACK_HTTP:
    case LWS_CALLBACK_RAW_ADOPT: // CONNECT
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return -1;
    default:
        return 0;
    }
}

// Out of the registrar's thread.
static void wake(void *user) {
    ws_server_wake(((struct control *)user)->server);
}

// ---- life ---------------------------------------------------------------------------------------

static const struct lws_protocols protocols[] = {
    {.name = "other", .callback = on_control_other},
    {.name = WIRE_SUBPROTOCOL, .callback = on_peer, .per_session_data_size = sizeof(struct peer)},
    {.name = WIRE_ENROL_SUBPROTOCOL,
     .callback = on_peer,
     .per_session_data_size = sizeof(struct peer)},
    {0},
};

// Where the authority keeps what a server shows.
struct server_files {
    char authority[4096], certificate[4096], key[4096];
};

static struct server_files paths_in(const char *dir) {
    struct server_files paths;
    snprintf(paths.authority, sizeof paths.authority, "%s/authority.pem", dir);
    snprintf(paths.certificate, sizeof paths.certificate, "%s/server.pem", dir);
    snprintf(paths.key, sizeof paths.key, "%s/server.key", dir);
    return paths;
}

// A peer's own pings tell whether it lives. libwebsockets would sort a timer with each message.
static const lws_retry_bo_t no_pings = {0};

static enum result listen_at(struct control *control, const struct control_config *config,
                             const struct server_files *paths, struct error *err) {
    int spare, places = ws_server_places(door_places(config->stations), SPARE_FDS, &spare);
    const struct lws_context_creation_info info = {
        .iface = config->address,
        .port = config->port,
        .protocols = protocols,
        .ssl_ca_filepath = paths->authority,
        .ssl_cert_filepath = paths->certificate,
        .ssl_private_key_filepath = paths->key,
        .timeout_secs = HANDSHAKE_S,
        .fd_limit_per_thread = (unsigned)(places + spare),
        .retry_and_idle_policy = &no_pings,
        .vhost_name = "control",
    };
    const struct ws_server_handler handler = {
        .user = control, .on_wake = on_control_wake, .on_stop = on_stop, .is_empty = is_empty};
    control->door = door_create(config->stations, places, shut_connection);
    return ws_server_create(WS_SERVER_TLS, &info, &handler, &control->server, err);
}

static enum result open_files(const struct server_files *paths, struct tls_files **out_files,
                              struct error *err) {
    if (access(paths->authority, R_OK))
        return fail(err, RESULT_MISSING, "%s: %s", paths->authority, strerror(errno));
    return tls_files_create(paths->certificate, paths->key, out_files, NULL, err);
}

static void release(struct control *control) {
    pthread_mutex_destroy(&control->lock);
    door_destroy(&control->door);
    free(control->slots);
    free(control->woken);
    free(control->serving);
    free(control->software);
    free(control);
}

enum result control_create(const struct control_config *config,
                           const struct control_handler *handler, struct control **out_control,
                           struct error *err) {
    struct control *control = alloc(1, sizeof *control);
    control->handler = *handler;
    control->software = alloc_text(config->software);
    control->hello_timeout_ns = config->hello_timeout_ns;
    control->slot_count = control_peers(config->stations);
    control->slots = alloc((size_t)control->slot_count, sizeof *control->slots);
    control->woken = alloc((size_t)control->slot_count, sizeof *control->woken);
    control->serving = alloc((size_t)control->slot_count, sizeof *control->serving);
    pthread_mutex_init(&control->lock, NULL);
    *out_control = NULL;
    const struct server_files paths = paths_in(config->authority_dir);
    struct tls_files *tls_files = NULL;
    enum result result = open_files(&paths, &tls_files, err);
    if (result == RESULT_OK)
        result = listen_at(control, config, &paths, err);
    if (result != RESULT_OK) {
        tls_files_destroy(&tls_files);
        release(control);
        return result;
    }
    control->registrar = registrar_create(config->authority_dir, tls_files, wake, control);
    *out_control = control; // before the thread runs: its handler may ask for it
    on_round(&control->round);
    ws_server_start(control->server);
    return RESULT_OK;
}

void control_destroy(struct control **control) {
    struct control *c = *control;
    ws_server_stop(c->server);
    registrar_destroy(&c->registrar);
    ws_server_destroy(&c->server); // not before: until now it could still be woken
    release(c);
    *control = NULL;
}

int control_port(const struct control *control) {
    return ws_server_port(control->server);
}

struct control_counts control_counts(const struct control *control) {
    return (struct control_counts){
        .unknown_messages = atomic_load(&control->unknown_messages),
        .malformed_messages = atomic_load(&control->malformed_messages),
        .refused_certificates = atomic_load(&control->refused_certificates),
        .replies_dropped = atomic_load(&control->replies_dropped),
        .shut = atomic_load(&control->shut),
    };
}

int64_t control_round_ns(const struct control *control) {
    return atomic_load(&control->round_ns);
}
