#include "net/control.h"

#include "base/check.h"
#include "base/listen.h"
#include "base/log.h"
#include "net/control_parts.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/ssl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define STRANGERS_MAX 64 // connections that have not said Hello yet
#define UNSENT_MAX 16384
#define HANDSHAKE_S 5
#define DRAIN_US (500 * LWS_US_PER_MS)

// ---- queues -------------------------------------------------------------------------------------

void control_say(struct peer *peer, const arthron_Control *message, bool last) {
    if (peer->closing)
        return;
    peer->closing = last;
    outgoing_encode(message, &peer->urgent);
    peer->urgent.last = last;
    if (last)
        lws_set_timer_usecs(peer->wsi, LWS_USEC_PER_SEC);
    lws_callback_on_writable(peer->wsi);
}

bool control_seat(struct peer *peer) {
    struct control *control = peer->control;
    struct outbox *outbox = outbox_create();
    int index = 0;
    pthread_mutex_lock(&control->lock);
    while (index < CONTROL_PEERS_MAX && control->slots[index].peer)
        index++;
    if (index < CONTROL_PEERS_MAX) {
        struct slot *slot = &control->slots[index];
        *slot = (struct slot){.generation = slot->generation + 1,
                              .peer = peer,
                              .outbox = outbox,
                              .meshes = peer->meshes,
                              .until_s = peer->identity.until_s};
        peer->handle = (struct control_peer){index, slot->generation};
    }
    pthread_mutex_unlock(&control->lock);
    if (index == CONTROL_PEERS_MAX)
        outbox_destroy(&outbox);
    return index < CONTROL_PEERS_MAX;
}

void control_unseat(struct peer *peer) {
    struct slot *slot = &peer->control->slots[peer->handle.index];
    pthread_mutex_lock(&peer->control->lock);
    slot->peer = NULL;
    pthread_mutex_unlock(&peer->control->lock);
    outbox_destroy(&slot->outbox);
    control_drop_meshes(slot);
}

struct slot *control_find_slot(struct control *control, struct control_peer handle) {
    CHECK(handle.index >= 0 && handle.index < CONTROL_PEERS_MAX);
    struct slot *slot = &control->slots[handle.index];
    return slot->peer && slot->generation == handle.generation ? slot : NULL;
}

int64_t control_certificate_end(struct control *control, struct control_peer handle) {
    pthread_mutex_lock(&control->lock);
    const struct slot *slot = control_find_slot(control, handle);
    int64_t until_s = slot ? slot->until_s : 0;
    pthread_mutex_unlock(&control->lock);
    return until_s;
}

bool control_send(struct control *control, struct control_peer handle,
                  const arthron_Control *message) {
    enum outbox_put put = OUTBOX_DROPPED;
    bool wakes = true;
    struct outgoing out;
    outgoing_encode(message, &out);
    pthread_mutex_lock(&control->lock);
    struct slot *slot = control_find_slot(control, handle);
    if (slot) {
        put = outbox_put(slot->outbox, message, &out);
        slot->overflown |= put == OUTBOX_OVERFLOWN;
        wakes = slot->wakes;
        slot->wakes = true;
    }
    pthread_mutex_unlock(&control->lock);
    if (slot && put == OUTBOX_DROPPED && message->which_message == arthron_Control_reply_tag)
        atomic_fetch_add(&control->replies_dropped, 1);
    if (!wakes)
        lws_cancel_service(control->context);
    return put == OUTBOX_QUEUED;
}

// ---- the control thread -------------------------------------------------------------------------

static void serve(struct control *control, const struct slot *slot) {
    struct peer *peer = slot->peer;
    if (control->draining)
        peer_refuse(peer, arthron_Refusal_Reason_SHUTDOWN, "the server stops");
    else if (slot->overflown)
        lws_set_timeout(peer->wsi, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    else
        lws_callback_on_writable(peer->wsi);
}

static void on_drained(lws_sorted_usec_list_t *drain) {
    lws_container_of(drain, struct control, drain)->drained = true;
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

static void on_wake(struct control *control) {
    if (atomic_load(&control->stopping) && !control->draining) {
        control->draining = true;
        lws_sul_schedule(control->context, 0, &control->drain, on_drained, DRAIN_US);
    }
    for (int i = 0; i < CONTROL_PEERS_MAX; i++) {
        pthread_mutex_lock(&control->lock);
        struct slot slot = control->slots[i];
        control->slots[i].wakes = false;
        pthread_mutex_unlock(&control->lock);
        if (slot.peer && (slot.wakes || control->draining))
            serve(control, &slot);
    }
    hand_out_answers(control);
    take_certificate(control);
}

// So little may wait in the kernel: a reply does not queue there behind a mesh.
static void keep_queue_short(struct lws *wsi) {
    int bytes = UNSENT_MAX;
    setsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &bytes, sizeof bytes);
}

static int open_peer(struct control *control, struct peer *peer, struct lws *wsi, bool enrols) {
    if (control->draining || control->connections == CONTROL_PEERS_MAX + STRANGERS_MAX)
        return -1;
    peer->control = control;
    peer->wsi = wsi;
    peer->enrols = enrols;
    control->connections++;
    keep_queue_short(wsi);
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

static int hear(struct peer *peer, const void *bytes, size_t size) {
    int64_t now_ns = clock_now_ns();
    if (peer->closing)
        return 0;
    if (size > sizeof peer->incoming - peer->used || !lws_frame_is_binary(peer->wsi)) {
        peer_malformed(peer, "messages are binary and not longer than 8192 bytes");
        return 0;
    }
    memcpy(peer->incoming + peer->used, bytes, size);
    peer->used += size;
    if (lws_remaining_packet_payload(peer->wsi) || !lws_is_final_fragment(peer->wsi))
        return 0;
    peer_heard(peer, now_ns);
    peer->used = 0;
    return 0;
}

static bool next_to_say(struct peer *peer, struct outgoing *out) {
    if (peer->urgent.size) {
        *out = peer->urgent;
        peer->urgent.size = 0;
        return true;
    }
    return peer->agreed && !peer->closing &&
           outbox_take(peer->control->slots[peer->handle.index].outbox, &peer->control->lock, out);
}

static int write_message(struct peer *peer, uint8_t *bytes, size_t size) {
    if (lws_write(peer->wsi, bytes, size, LWS_WRITE_BINARY) < (int)size)
        return -1;
    lws_callback_on_writable(peer->wsi);
    return 0;
}

static int say(struct peer *peer) {
    struct outgoing out;
    if (peer->done) {
        lws_close_reason(peer->wsi, LWS_CLOSE_STATUS_POLICY_VIOLATION, NULL, 0);
        return -1;
    }
    if (next_to_say(peer, &out)) {
        peer->done = out.last;
        return write_message(peer, out.bytes, out.size);
    }
    size_t size = peer->agreed && !peer->closing ? control_next_chunk(peer) : 0;
    return size ? write_message(peer, peer->control->chunk_bytes.bytes, size) : 0;
}

static int tick(struct peer *peer) {
    int64_t next_us;
    if (!peer_tick(peer, clock_now_ns(), &next_us))
        return -1;
    lws_set_timer_usecs(peer->wsi, next_us);
    return 0;
}

static int on_peer(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *bytes,
                   size_t size) {
    struct control *control = lws_context_user(lws_get_context(wsi));
    switch (reason) {
    case LWS_CALLBACK_ESTABLISHED:
        return open_peer(control, user, wsi,
                         !strcmp(lws_get_protocol(wsi)->name, WIRE_ENROL_SUBPROTOCOL));
    case LWS_CALLBACK_RECEIVE:
        return hear(user, bytes, size);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return say(user);
    case LWS_CALLBACK_TIMER:
        return tick(user);
    case LWS_CALLBACK_CLOSED:
        return close_peer(user);
    default:
        return 0;
    }
}

// What is no WebSocket, or names no subprotocol of ours, and what concerns the whole server.
static int on_other(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *bytes,
                    size_t size) {
    (void)size;
    struct control *control = lws_context_user(lws_get_context(wsi));
    switch (reason) {
    case LWS_CALLBACK_OPENSSL_LOAD_EXTRA_SERVER_VERIFY_CERTS:
        control->tls = user;
        identity_ask(user, &control->refused_certificates);
        return 0;
    case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
        on_wake(control);
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
    lws_cancel_service(((struct control *)user)->context);
}

static void *serve_peers(void *argument) {
    struct control *control = argument;
    while (!control->drained && !(control->draining && control->connections == 0))
        lws_service(control->context, 0);
    return NULL;
}

// ---- life ---------------------------------------------------------------------------------------

static const struct lws_protocols protocols[] = {
    {.name = "other", .callback = on_other},
    {.name = WIRE_SUBPROTOCOL, .callback = on_peer, .per_session_data_size = sizeof(struct peer)},
    {.name = WIRE_ENROL_SUBPROTOCOL,
     .callback = on_peer,
     .per_session_data_size = sizeof(struct peer)},
    {0},
};

static bool machine_has_ipv6(void) {
    int fd = socket(AF_INET6, SOCK_STREAM, 0);
    if (fd >= 0)
        close(fd);
    return fd >= 0;
}

static uint64_t options_for(const char *address) {
    bool ipv6 = address ? strchr(address, ':') != NULL : machine_has_ipv6();
    return LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT | LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND |
           LWS_SERVER_OPTION_EXPLICIT_VHOSTS | (ipv6 ? 0 : LWS_SERVER_OPTION_DISABLE_IPV6);
}

// Where the authority keeps what a server shows.
struct paths {
    char authority[4096], certificate[4096], key[4096];
};

static struct paths paths_in(const char *dir) {
    struct paths paths;
    snprintf(paths.authority, sizeof paths.authority, "%s/authority.pem", dir);
    snprintf(paths.certificate, sizeof paths.certificate, "%s/server.pem", dir);
    snprintf(paths.key, sizeof paths.key, "%s/server.key", dir);
    return paths;
}

static enum result listen_at(struct control *control, const struct control_config *config,
                             const struct paths *paths, struct error *err) {
    struct lws_context_creation_info info = {
        .iface = config->address,
        .port = config->port,
        .protocols = protocols,
        .ssl_ca_filepath = paths->authority,
        .ssl_cert_filepath = paths->certificate,
        .ssl_private_key_filepath = paths->key,
        .provided_client_ssl_ctx = control->no_client,
        .alpn = "http/1.1",
        .options = options_for(config->address),
        .timeout_secs = HANDSHAKE_S,
        .fd_limit_per_thread = CONTROL_PEERS_MAX + 2 * STRANGERS_MAX,
        .vhost_name = "control",
        .user = control,
        .gid = -1,
        .uid = -1,
    };
    control->context = lws_create_context(&info);
    CHECK(control->context);
    struct lws_vhost *vhost = lws_create_vhost(control->context, &info);
    if (!vhost)
        return listen_check(config->address, config->port, err) != RESULT_OK
                   ? RESULT_IO
                   : fail(err, RESULT_IO, "port %d: cannot listen with the certificate %s",
                          config->port, paths->certificate);
    control->port = lws_get_vhost_listen_port(vhost);
    return RESULT_OK;
}

static enum result open_files(const struct paths *paths, struct tls_files **out_files,
                              struct error *err) {
    if (access(paths->authority, R_OK))
        return fail(err, RESULT_MISSING, "%s: %s", paths->authority, strerror(errno));
    return tls_files_create(paths->certificate, paths->key, out_files, NULL, err);
}

static void release(struct control *control) {
    pthread_mutex_destroy(&control->lock);
    SSL_CTX_free(control->no_client);
    free(control->software);
    free(control);
}

enum result control_create(const struct control_config *config,
                           const struct control_handler *handler, struct control **out_control,
                           struct error *err) {
    lws_set_log_level(0, NULL);
    struct control *control = alloc(1, sizeof *control);
    control->handler = *handler;
    control->software = alloc_text(config->software);
    control->hello_timeout_ns = config->hello_timeout_ns;
    control->enrol_checked_ns = -(1LL << 62); // all of the budget is there
    control->no_client = SSL_CTX_new(TLS_client_method());
    CHECK(control->no_client);
    pthread_mutex_init(&control->lock, NULL);
    *out_control = NULL;
    const struct paths paths = paths_in(config->authority_dir);
    struct tls_files *tls_files = NULL;
    enum result result = open_files(&paths, &tls_files, err);
    if (result == RESULT_OK)
        result = listen_at(control, config, &paths, err);
    if (result != RESULT_OK) {
        if (control->context)
            lws_context_destroy(control->context);
        tls_files_destroy(&tls_files);
        release(control);
        return result;
    }
    control->registrar = registrar_create(config->authority_dir, tls_files, wake, control);
    *out_control = control; // before the thread runs: its handler may ask for it
    CHECK(pthread_create(&control->thread, NULL, serve_peers, control) == 0);
    return RESULT_OK;
}

void control_destroy(struct control **control) {
    struct control *c = *control;
    atomic_store(&c->stopping, true);
    lws_cancel_service(c->context);
    pthread_join(c->thread, NULL);
    registrar_destroy(&c->registrar);
    lws_context_destroy(c->context); // not before: until now it could still be woken
    release(c);
    *control = NULL;
}

int control_port(const struct control *control) {
    return control->port;
}

struct control_counts control_counts(const struct control *control) {
    return (struct control_counts){
        .unknown_messages = atomic_load(&control->unknown_messages),
        .malformed_messages = atomic_load(&control->malformed_messages),
        .refused_certificates = atomic_load(&control->refused_certificates),
        .replies_dropped = atomic_load(&control->replies_dropped),
    };
}
