// The control connection: libwebsockets' client in a thread of its own, reconnecting for ever.
#include "base/check.h"
#include "base/log.h"
#include "link/link_parts.h"
#include "link/trouble.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#define DATAGRAMS_LIVE_NS (2 * NS_PER_S)
#define CONNECT_S 5
#define WELCOME_PATIENCE_US (3 * LWS_US_PER_SEC) // until Welcome, while there is another server
#define QUEUE_LENGTH 16
#define UTC_MAX_S (INT64_C(1) << 40)

static const uint32_t delays_ms[] = {100, 200, 400, 800, 1600, 3200, 4000};
static const lws_retry_bo_t backoff = {
    .retry_ms_table = delays_ms,
    .retry_ms_table_count = sizeof delays_ms / sizeof *delays_ms,
    .conceal_count = LWS_RETRY_CONCEAL_ALWAYS,
    .jitter_percent = 25,
};

// ---- saying -------------------------------------------------------------------------------------

static void control_encode(const arthron_Control *message, struct control_message *out) {
    size_t size;
    enum result result = wire_encode_control(message, out->bytes, sizeof out->bytes, &size);
    CHECK(result == RESULT_OK); // every message of the schema fits WIRE_CONTROL_MAX
    out->size = (uint32_t)size;
}

bool control_push(struct ring *queue, const arthron_Control *message) {
    struct control_message out;
    control_encode(message, &out);
    return ring_push(queue, &out);
}

static void say(struct link *link, const arthron_Control *message) {
    if (!control_push(link->control.queue, message)) // the server floods us, or takes nothing
        lws_set_timeout(link->control.socket, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    lws_callback_on_writable(link->control.socket);
}

static void say_hello(struct link *link) {
    arthron_Control message = {.which_message = arthron_Control_hello_tag};
    link_introduce(link, &message.message.hello);
    say(link, &message);
}

static bool take_marker(struct link *link, struct control_message *out) {
    arthron_Control message;
    bool taken = link->control.session_open && link_next_marker(link, &message);
    if (taken)
        control_encode(&message, out);
    return taken;
}

static int write_next(struct link *link) {
    struct control_message out;
    struct control_connection *control = &link->control;
    if (!ring_pop(control->queue, &out) && !ring_pop(link->frames, &out) &&
        !take_marker(link, &out))
        return 0;
    if (lws_write(control->socket, out.bytes, out.size, LWS_WRITE_BINARY) < (int)out.size)
        return -1;
    lws_callback_on_writable(control->socket);
    return 0;
}

// ---- hearing ------------------------------------------------------------------------------------

static bool hand_over(struct link *link, struct arrival *arrival) {
    uint64_t one = 1;
    arrival->connect = atomic_load(&link->connects);
    if (!ring_push(link->arrivals, arrival))
        return false;
    return write(link->arrival_fd, &one, sizeof one) == sizeof one;
}

static bool is_up_to_date(struct link *link, const arthron_Welcome *welcome) {
    struct servers *servers = &link->control.servers;
    uint64_t token = link->config.visit ? 0 : welcome->token;
    if (servers_welcomed(servers, welcome->session_id, token, clock_now_ns()))
        return true;
    const struct server_address *server = servers_present(servers);
    log_warning("link", "%s, port %d is left: another server has taken its session over",
                server->host, server->port);
    return false;
}

static int hear_welcome(struct link *link, const arthron_Welcome *welcome) {
    if (!is_up_to_date(link, welcome))
        return -1;
    const struct server_address *server = servers_present(&link->control.servers);
    lws_sul_cancel(&link->control.patience);
    link->control.welcomed = true;
    link_agree(link, welcome);
    meshes_set_case(link->meshes, welcome->case_hash);
    atomic_fetch_add(&link->connects, 1);
    pthread_mutex_lock(&link->lock);
    link->status.welcomed = true;
    link->status.state = (arthron_SessionState)welcome->state;
    link->status.hold_ms = welcome->hold_ms < INT_MAX ? (int)welcome->hold_ms : INT_MAX;
    link->status.utc_known = welcome->utc_s > 0 && welcome->utc_s < UTC_MAX_S;
    if (link->status.utc_known)
        link->status.utc_ahead_s = welcome->utc_s - clock_utc_ns() / NS_PER_S;
    snprintf(link->status.session_case, sizeof link->status.session_case, "%s", welcome->case_name);
    link->status.refusal[0] = link->status.problem[0] = '\0';
    link->status.clock_is_wrong = false;
    pthread_mutex_unlock(&link->lock);
    link->control.attempts = 0;
    memset(link->control.trouble, 0, sizeof link->control.trouble);
    log_info("link", "welcomed by %s, port %d (%s), case %s", server->host, server->port,
             welcome->software, welcome->case_name);
    lws_set_timer_usecs(link->control.socket, 0);
    return 0;
}

// Ends the connection.
static int go_on_after(struct link *link, int next_ms) {
    link->control.decided = true;
    link->control.next_ms = next_ms;
    return -1;
}

static int go_elsewhere(struct link *link, const char *server) {
    struct server_address to;
    struct servers *servers = &link->control.servers;
    const struct server_address *from = servers_present(servers);
    bool is_address = server_parse(server, &to);
    log_info("link", "%s, port %d sends the station to %s", from->host, from->port,
             is_address ? server : "no address");
    return go_on_after(link, servers_elsewhere(servers, is_address ? &to : NULL, clock_now_ns()));
}

static int hear_refusal(struct link *link, const arthron_Refusal *refusal) {
    struct servers *servers = &link->control.servers;
    pthread_mutex_lock(&link->lock);
    bool again = !strcmp(link->status.refusal, refusal->text);
    snprintf(link->status.refusal, sizeof link->status.refusal, "%s", refusal->text);
    link->status.refusal_reason = refusal->reason;
    pthread_mutex_unlock(&link->lock);
    if (refusal->reason == arthron_Refusal_Reason_ELSEWHERE)
        return go_elsewhere(link, refusal->server);
    if (!again)
        log_warning("link", "the server refuses: %s", refusal->text);
    return go_on_after(link, refusal->retry_ms
                                 ? servers_ask_again(servers, refusal->retry_ms, clock_now_ns())
                                 : servers_lost(servers, false, clock_now_ns()));
}

// Called when either of the two has changed.
static void update_ready(struct link *link) {
    atomic_store(&link->ready, link->status.clock_known && link->control.session_open);
}

static void ask_for_meshes(struct link *link) {
    arthron_Control ask;
    meshes_ask(link->meshes, &ask);
    say(link, &ask);
}

static void keep_session(struct link *link, const arthron_SessionChange *change) {
    struct link_session *session = &link->session;
    session->connection = atomic_load(&link->connects);
    session->server = *servers_present(&link->control.servers);
    session->state = (arthron_SessionState)change->state;
    memcpy(session->case_name, change->case_name, sizeof session->case_name);
    session->case_hash = change->case_hash;
    session->has_knee = change->has_knee;
    wire_knee_to(&change->knee, &session->knee);
}

static void hear_change(struct link *link, const arthron_SessionChange *change) {
    bool opens = !link->control.session_open && change->state != arthron_SessionState_CLOSED;
    link->control.session_open = change->state != arthron_SessionState_CLOSED;
    meshes_set_case(link->meshes, change->case_hash);
    if (opens && link->control.meshes)
        ask_for_meshes(link);
    if (opens && link->control.markers) {
        marker_queue_begin(&link->markers);
        lws_callback_on_writable(link->control.socket);
    }
    pthread_mutex_lock(&link->lock);
    bool is_new = change->text[0] && strcmp(link->status.refusal, change->text) != 0;
    link->status.state = (arthron_SessionState)change->state;
    snprintf(link->status.session_case, sizeof link->status.session_case, "%s", change->case_name);
    snprintf(link->status.refusal, sizeof link->status.refusal, "%s", change->text);
    keep_session(link, change);
    pthread_mutex_unlock(&link->lock);
    if (is_new)
        log_warning("link", "the server says: %s", change->text);
    atomic_fetch_add(&link->session_changes, 1);
    update_ready(link);
}

static void hear_ping(struct link *link, const arthron_Ping *ping, int64_t received_ns) {
    arthron_Control answer = {.which_message = arthron_Control_pong_tag};
    answer.message.pong = (arthron_Pong){ping->sent_ns, received_ns, clock_now_ns()};
    say(link, &answer);
}

static bool is_remote_time(int64_t time_ns) {
    return time_ns >= 0 && time_ns < WIRE_TIME_MAX_NS;
}

static int64_t shortest_round_trip(const struct clock_offset *clock) {
    int64_t shortest_ns = INT64_MAX;
    for (int i = 0; i < clock->count; i++)
        if (clock->exchanges[i].round_trip_ns < shortest_ns)
            shortest_ns = clock->exchanges[i].round_trip_ns;
    return shortest_ns;
}

static void hear_pong(struct link *link, const arthron_Pong *pong, int64_t received_ns) {
    struct control_connection *control = &link->control;
    int64_t offset_ns, uncertainty_ns;
    pings_answered(&control->pings, received_ns);
    if (pong->sent_ns < 0 || pong->sent_ns > received_ns || !is_remote_time(pong->received_ns) ||
        !is_remote_time(pong->answered_ns) ||
        !clock_offset_add(&control->clock, pong->sent_ns, pong->received_ns, pong->answered_ns,
                          received_ns) ||
        !clock_offset_get(&control->clock, received_ns, &offset_ns, &uncertainty_ns))
        return;
    pthread_mutex_lock(&link->lock);
    link->status.clock_known = true;
    link->status.clock_offset_ns = offset_ns;
    link->status.clock_uncertainty_ns = uncertainty_ns;
    link->status.round_trip_ns = shortest_round_trip(&control->clock);
    pthread_mutex_unlock(&link->lock);
    update_ready(link);
}

static int hear_keys(struct link *link, const arthron_UdpKeys *keys) {
    struct arrival arrival = {.is_keys = true, .keys = *keys};
    socklen_t size = sizeof arrival.server;
    if (!link->config.datagrams)
        return 0;
    if (getpeername(lws_get_socket_fd(link->control.socket), (struct sockaddr *)&arrival.server,
                    &size))
        return -1;
    return hand_over(link, &arrival) ? 0 : -1;
}

// Of an older server. Any other puts it in a reply: who reads it there is where datagrams arrive.
static void hear_path(struct link *link, const arthron_Control *message) {
    if (link->control.path)
        log_warning("link", "the server asks for a path in the wrong way; the station is silent");
    else
        say(link, message);
}

static int hear_welcomed(struct link *link, const arthron_Control *message, int64_t now_ns) {
    struct arrival arrival;
    switch (message->which_message) {
    case arthron_Control_session_change_tag:
        hear_change(link, &message->message.session_change);
        return 0;
    case arthron_Control_ping_tag:
        hear_ping(link, &message->message.ping, now_ns);
        return 0;
    case arthron_Control_pong_tag:
        hear_pong(link, &message->message.pong, now_ns);
        return 0;
    case arthron_Control_udp_path_tag:
        hear_path(link, message);
        return 0;
    case arthron_Control_udp_keys_tag:
        return hear_keys(link, &message->message.udp_keys);
    case arthron_Control_reply_tag:
        arrival = (struct arrival){.reply = message->message.reply};
        hand_over(link, &arrival); // full: the caller does not wait for replies
        return 0;
    case arthron_Control_marker_ack_tag:
        marker_queue_acknowledge(&link->markers, message->message.marker_ack.number);
        lws_callback_on_writable(link->control.socket); // others may go now
        return 0;
    case arthron_Control_attempt_tag:
        link_keep_attempt(link, &message->message.attempt);
        return 0;
    case arthron_Control_moved_tag:
        return go_elsewhere(link, message->message.moved.server);
    case arthron_Control_resection_tag:
        return 0; // figures for a view
    default:
        log_warning("link", "the server sent a message that only a station may send");
        return -1;
    }
}

static int hear_message(struct link *link, const arthron_Control *message, int64_t now_ns) {
    if (message->which_message == 0) {
        atomic_fetch_add(&link->unknown_messages, 1);
    } else if (message->which_message == arthron_Control_refusal_tag) {
        return hear_refusal(link, &message->message.refusal);
    } else if (link->control.welcomed) {
        return hear_welcomed(link, message, now_ns);
    } else if (message->which_message == arthron_Control_welcome_tag) {
        return hear_welcome(link, &message->message.welcome);
    } else {
        log_warning("link", "the server's first message is not Welcome");
        return -1;
    }
    return 0;
}

static int hear_chunk(struct link *link, size_t size) {
    struct control_connection *control = &link->control;
    arthron_Control answer;
    struct error err;
    if (wire_decode_chunk(control->incoming, size, &control->chunk, &err) != RESULT_OK) {
        log_warning("link", "the server sent a malformed message: %s", err.text);
        return -1;
    }
    if (meshes_hear(link->meshes, &control->chunk, &answer))
        say(link, &answer);
    return 0;
}

static int hear_control(struct link *link, const void *bytes, size_t size) {
    struct control_connection *control = &link->control;
    int64_t now_ns = clock_now_ns();
    struct error err;
    if (size > sizeof control->incoming - control->used) {
        log_warning("link", "the server sent a message that is too long");
        return -1;
    }
    memcpy(control->incoming + control->used, bytes, size);
    control->used += size;
    if (lws_remaining_packet_payload(control->socket) || !lws_is_final_fragment(control->socket))
        return 0;
    size_t whole = control->used;
    control->used = 0;
    if (control->meshes && wire_is_chunk(control->incoming, whole))
        return hear_chunk(link, whole);
    if (wire_decode_control(control->incoming, whole, &control->message, &err) != RESULT_OK) {
        log_warning("link", "the server sent a malformed message: %s", err.text);
        return -1;
    }
    return hear_message(link, &control->message, now_ns);
}

static void ping(struct link *link, int64_t now_ns) {
    struct pings *pings = &link->control.pings;
    arthron_Control message = {.which_message = arthron_Control_ping_tag};
    if (!pings_due(pings, atomic_load(&link->frames_sent), now_ns))
        return;
    message.message.ping = (arthron_Ping){.sent_ns = now_ns, .rests = pings->rests};
    say(link, &message);
}

static int tick(struct link *link) {
    struct control_connection *control = &link->control;
    int64_t now_ns = clock_now_ns();
    bool has_datagrams = now_ns - atomic_load(&link->datagram_ns) < DATAGRAMS_LIVE_NS;
    bool has_other = servers_has_other(&control->servers);
    if (pings_are_missed(&control->pings, has_datagrams, has_other, now_ns)) {
        control->was_silent = true;
        log_warning("link", "no answer from the server for %d s",
                    (int)((now_ns - control->pings.answered_ns) / NS_PER_S));
        return -1;
    }
    if (atomic_load(&link->keys_changed)) { // only a new connection can show them
        log_info("link", "the station's certificate has changed: connecting again");
        return go_on_after(link, SERVERS_BACK_OFF);
    }
    ping(link, now_ns);
    lws_set_timer_usecs(control->socket, pings_next_ns(&control->pings) / 1000);
    return 0;
}

// ---- connecting ---------------------------------------------------------------------------------

static void try_again(struct link *link);

static void log_trouble(struct link *link, const char *text) {
    const struct server_address *server = servers_present(&link->control.servers);
    char *last = link->control.trouble[link->control.servers.present];
    if (atomic_load(&link->stopping) || !strcmp(last, text))
        return;
    snprintf(last, sizeof *link->control.trouble, "%s", text);
    pthread_mutex_lock(&link->lock);
    snprintf(link->status.problem, sizeof link->status.problem, "%s", text);
    link->status.clock_is_wrong = link->trust.clock_is_wrong;
    pthread_mutex_unlock(&link->lock);
    log_warning("link", "no connection to %s, port %d: %s", server->host, server->port, text);
}

static void take_keys(struct link *link) {
    struct error err;
    if (atomic_exchange(&link->keys_changed, false) &&
        trust_renew(&link->trust, link->config.keys_dir, &err) != RESULT_OK)
        log_warning("link", "%s; keeping the previous certificate", err.text);
}

static void lose_control_patience(lws_sorted_usec_list_t *patience) {
    struct control_connection *control =
        lws_container_of(patience, struct control_connection, patience);
    struct link *link = lws_container_of(control, struct link, control);
    log_trouble(link, "the server does not answer. Check that it runs, and check host, port and "
                      "network");
    control->was_silent = true;
    lws_set_timeout(control->socket, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
}

static void connect_to(struct link *link, const struct server_address *server) {
    struct control_connection *control = &link->control;
    struct lws_client_connect_info info = {
        .context = control->context,
        .address = server->host,
        .port = server->port,
        .host = server->host,
        .origin = server->host,
        .path = "/",
        .protocol = WIRE_SUBPROTOCOL,
        .alpn = "http/1.1",
        // trust.c checks the name, for addresses too
        .ssl_connection = LCCSCF_USE_SSL | LCCSCF_SKIP_SERVER_CERT_HOSTNAME_CHECK,
        .pwsi = &control->socket,
    };
    struct error err;
    if (trust_expect(&link->trust, server->host, &err) != RESULT_OK) { // another server named it
        log_trouble(link, err.text);
        try_again(link);
        return;
    }
    if (servers_has_other(&control->servers))
        lws_sul_schedule(control->context, 0, &control->patience, lose_control_patience,
                         WELCOME_PATIENCE_US);
    if (!lws_client_connect_via_info(&info)) {
        log_trouble(link, trouble_sentence(NULL));
        try_again(link);
    }
}

static void connect_now(lws_sorted_usec_list_t *retry) {
    struct control_connection *control = lws_container_of(retry, struct control_connection, retry);
    struct link *link = lws_container_of(control, struct link, control);
    const struct server_address *server = servers_present(&control->servers);
    take_keys(link);
    link->trust.problem[0] = '\0';
    link->trust.clock_is_wrong = false;
    control->connecting = true;
    control->decided = control->was_silent = false;
    pthread_mutex_lock(&link->lock);
    link->status.server = *server;
    pthread_mutex_unlock(&link->lock);
    connect_to(link, server);
}

static void try_again(struct link *link) {
    struct control_connection *control = &link->control;
    control->socket = NULL;
    if (!control->connecting || atomic_load(&link->stopping))
        return;
    control->connecting = false;
    lws_sul_cancel(&control->patience);
    int next_ms = control->decided
                      ? control->next_ms
                      : servers_lost(&control->servers, control->was_silent, clock_now_ns());
    if (next_ms == SERVERS_BACK_OFF)
        lws_retry_sul_schedule(control->context, 0, &control->retry, &backoff, connect_now,
                               &control->attempts);
    else
        lws_sul_schedule(control->context, 0, &control->retry, connect_now,
                         next_ms * LWS_US_PER_MS + 1);
}

static void connected(struct link *link, struct lws *socket) {
    struct control_connection *control = &link->control;
    struct control_message stale;
    while (ring_pop(control->queue, &stale) || ring_pop(link->frames, &stale))
        ;
    control->socket = socket;
    control->clock = (struct clock_offset){0};
    control->used = 0;
    pings_begin(&control->pings, clock_now_ns());
    control->welcomed = false;
    control->meshes = false;
    control->session_open = false;
    say_hello(link);
}

static void disconnected(struct link *link) {
    atomic_store(&link->ready, false);
    pthread_mutex_lock(&link->lock);
    bool welcomed = link->status.welcomed;
    link->status.welcomed = false;
    link->status.clock_known = false;
    pthread_mutex_unlock(&link->lock);
    if (welcomed && !link->control.decided)
        log_trouble(link,
                    "the connection was lost. The station connects again when the server answers");
    try_again(link);
}

static int on_control_event(struct lws *socket, enum lws_callback_reasons reason, void *user,
                            void *bytes, size_t size) {
    (void)user;
    struct link *link = lws_context_user(lws_get_context(socket));
    switch (reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        connected(link, socket);
        return 0;
    case LWS_CALLBACK_CLIENT_RECEIVE:
        return hear_control(link, bytes, size);
    case LWS_CALLBACK_CLIENT_WRITEABLE:
        return write_next(link);
    case LWS_CALLBACK_TIMER:
        return tick(link);
    case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
        if (atomic_load(&link->ready))
            lws_callback_on_writable(link->control.socket);
        return 0;
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
        if (!link->control.was_silent)
            log_trouble(link,
                        link->trust.problem[0] ? link->trust.problem : trouble_sentence(bytes));
        return 0;
    case LWS_CALLBACK_WSI_DESTROY: // the one event that every end of a connection has
        if (socket == link->control.socket)
            disconnected(link);
        return 0;
    default:
        return 0;
    }
}

static const struct lws_protocols control_protocols[] = {
    {.name = WIRE_SUBPROTOCOL, .callback = on_control_event},
    {0},
};

static bool machine_has_ipv6(void) {
    int fd = socket(AF_INET6, SOCK_STREAM, 0);
    if (fd >= 0)
        close(fd);
    return fd >= 0;
}

enum result control_init(struct link *link, struct error *err) {
    struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN,
        .protocols = control_protocols,
        .provided_client_ssl_ctx = link->trust.context,
        .options = LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT |
                   (machine_has_ipv6() ? 0 : LWS_SERVER_OPTION_DISABLE_IPV6),
        .timeout_secs = CONNECT_S,
        .connect_timeout_secs = CONNECT_S,
        .user = link,
        .gid = -1,
        .uid = -1,
    };
    lws_set_log_level(0, NULL);
    servers_init(&link->control.servers, link->config.servers, link->config.server_count);
    link->control.queue = ring_create(QUEUE_LENGTH, sizeof(struct control_message));
    link->control.context = lws_create_context(&info);
    if (!link->control.context)
        return fail(err, RESULT_IO, "the station cannot set up a connection to a server");
    return RESULT_OK;
}

void control_serve(struct link *link) {
    struct control_connection *control = &link->control;
    lws_sul_schedule(control->context, 0, &control->retry, connect_now, 1);
    while (!atomic_load(&link->stopping))
        lws_service(control->context, 0);
}

void control_fini(struct link *link) {
    if (link->control.context)
        lws_context_destroy(link->control.context);
    ring_destroy(&link->control.queue);
}
