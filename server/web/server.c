#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "web/connection.h"

#include <errno.h>
#include <openssl/ssl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define HEADERS_MAX 8192 // bytes of a request's
#define HANDSHAKE_S 5
#define KEEP_ALIVE_S 30
#define TIMEOUT_S 20
#define RENEWAL_US LWS_USEC_PER_SEC
#define TURNS_S 4000
#define TURNS_AT_ONCE 400
#define TURN_PAUSE_US 1000

// ---- connections --------------------------------------------------------------------------------

static int filter_connection(struct web *web, int fd) {
    struct rate_limit *limit = rate_limits_find(web->limits, fd);
    return ws_server_stops(web->server) || !limit || !places_let_in(web, limit) ? -1 : 0;
}

static void read_address(struct lws *socket, char *out, size_t size) {
    char address[64] = "";
    lws_get_peer_simple(socket, address, sizeof address);
    const char *text = strncmp(address, "::ffff:", 7) ? address : address + 7;
    snprintf(out, size, "%.*s", (int)size - 1, text);
}

static int open_connection(struct web *web, struct lws *socket) {
    struct rate_limit *limit = rate_limits_find(web->limits, lws_get_socket_fd(socket));
    if (!limit)
        return -1;
    struct web_connection *connection = alloc(1, sizeof *connection);
    connection->web = web;
    connection->socket = socket;
    connection->limit = limit;
    connection->answer = answer_none();
    read_address(socket, connection->address, sizeof connection->address);
    if (!places_open(connection)) {
        free(connection);
        return -1;
    }
    ws_keep_queue_short(socket);
    lws_set_opaque_user_data(socket, connection);
    return 0;
}

static int end_connection(struct web_connection *connection) {
    if (!connection)
        return 0; // the listening socket, or one that came no further than TLS
    live_end(connection);
    http_end(connection);
    places_close(connection);
    lws_set_opaque_user_data(connection->socket, NULL);
    free(connection);
    return 0;
}

// ---- from other threads -------------------------------------------------------------------------

static void on_done(void *user) {
    ws_server_wake(((struct web *)user)->server);
}

static void hand_out_tasks(struct web *web) {
    for (struct web_task *task; (task = request_pool_take_done(web->pool));) {
        struct web_connection *connection = task->owner;
        if (connection)
            connection->away = false;
        if (!connection)
            web_task_destroy(&task);
        else if (task->kind == WEB_TASK_ACCOUNT)
            live_task_done(connection, task);
        else
            http_task_done(connection, task);
    }
}

static void on_wake(void *user) {
    struct web *web = user;
    hand_out_tasks(web);
    if (atomic_exchange(&web->woken, false))
        live_wake(web);
}

static void on_stop(void *user) {
    live_close_all(user);
}

static bool is_empty(void *user) {
    return ((const struct web *)user)->open_sockets == 0;
}

// ---- libwebsockets ------------------------------------------------------------------------------

static int on_http(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                   size_t size) {
    struct web *web = lws_context_user(lws_get_context(socket));
    struct web_connection *connection = lws_get_opaque_user_data(socket);
    switch (reason) {
    case LWS_CALLBACK_FILTER_NETWORK_CONNECTION:
        return filter_connection(web, (int)(intptr_t)bytes);
    case LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED:
        return open_connection(web, socket);
    case LWS_CALLBACK_WSI_DESTROY:
        return end_connection(connection);
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        return http_upgrade(connection, bytes);
    case LWS_CALLBACK_HTTP:
        return http_begin(connection);
    case LWS_CALLBACK_HTTP_BODY:
        return http_take_body(connection, bytes, size);
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
        return http_end_body(connection);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return http_write(connection);
    case LWS_CALLBACK_OPENSSL_LOAD_EXTRA_SERVER_VERIFY_CERTS:
        web->tls = user;
        return 0;
    case LWS_CALLBACK_RAW_ADOPT:                  // CONNECT
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION: // of no subprotocol of ours
        return -1;
    default:
        return 0;
    }
}

static int on_live(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                   size_t size) {
    (void)user;
    struct web_connection *connection = lws_get_opaque_user_data(socket);
    switch (reason) {
    case LWS_CALLBACK_ESTABLISHED:
        return live_open(connection);
    case LWS_CALLBACK_RECEIVE:
        return live_receive(connection, bytes, size);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return live_write(connection);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
        return ws_closed(socket, connection->live && connection->live->closing);
    case LWS_CALLBACK_TIMER: // it was to be closed
        return ws_end(socket);
    default:
        return 0;
    }
}

static const struct lws_protocols protocols[] = {
    {.name = "http", .callback = on_http, .tx_packet_size = WEB_BATCH_MAX},
    {.name = WIRE_LIVE_SUBPROTOCOL,
     .callback = on_live,
     .rx_buffer_size = WIRE_PAGE_MAX,
     .tx_packet_size = WEB_BATCH_MAX + LWS_PRE},
    {0},
};

// libwebsockets does not wait while there is something to read that it will not take yet: a client
// that speaks behind its request and does not read the answer would have a processor for itself.
static void limit_turns(void *user) {
    struct web *web = user;
    if (!bucket_take(&web->turns, TURNS_S, TURNS_AT_ONCE, clock_now_ns()))
        usleep(TURN_PAUSE_US);
}

// ---- life ---------------------------------------------------------------------------------------

static void on_renewal_due(lws_sorted_usec_list_t *due);

static void plan_renewal(struct web *web) {
    if (!web->tls_files)
        return;
    lws_sul_schedule(web->context, 0, &web->renewal_due, on_renewal_due, RENEWAL_US);
}

static void on_renewal_due(lws_sorted_usec_list_t *due) {
    struct web *web = lws_container_of(due, struct web, renewal_due);
    struct tls_credentials *credentials = tls_files_look(web->tls_files);
    if (credentials) {
        tls_credentials_use(credentials, web->tls);
        host_check_renew(web->hosts);
        log_info("web", "the certificate for browsers was renewed");
    }
    atomic_store(&web->certificate_until_s, tls_files_end_s(web->tls_files));
    tls_files_warn(web->tls_files, "web", "renew it (docs/INSTALL.md)");
    tls_credentials_destroy(&credentials);
    plan_renewal(web);
}

static enum result handler_starts(struct web *web, struct error *err) {
    const struct web_handler *handler = &web->handler;
    return handler->on_start ? handler->on_start(handler->user, web->context, web->outgoing, err)
                             : RESULT_OK;
}

static enum result listen_at(struct web *web, const struct web_config *config, struct error *err) {
    const struct lws_context_creation_info info = {
        .iface = config->address,
        .port = config->port,
        .protocols = protocols,
        .ssl_cert_filepath = config->certificate,
        .ssl_private_key_filepath = config->key,
        .ssl_options_set =
            SSL_OP_NO_SSLv3 | SSL_OP_NO_TLSv1 | SSL_OP_NO_TLSv1_1 | SSL_OP_NO_RENEGOTIATION,
        .timeout_secs = (unsigned)(web->timeout_s < HANDSHAKE_S ? web->timeout_s : HANDSHAKE_S),
        .timeout_secs_ah_idle = (unsigned)web->timeout_s,
        .keepalive_timeout = KEEP_ALIVE_S,
        .max_http_header_data = HEADERS_MAX,
        .max_http_header_pool = (unsigned)(web->places + web->spare + web->outgoing),
        .fd_limit_per_thread = (unsigned)(web->places + web->spare + web->outgoing),
        .retry_and_idle_policy = &web->liveness,
        .vhost_name = "web",
    };
    const struct ws_server_handler handler = {.user = web,
                                              .on_wake = on_wake,
                                              .on_stop = on_stop,
                                              .is_empty = is_empty,
                                              .after_turn = limit_turns};
    enum ws_server_kind kind = config->certificate ? WS_SERVER_TLS : WS_SERVER_PLAIN;
    enum result result = ws_server_create(kind, &info, &handler, &web->server, err);
    if (result != RESULT_OK)
        return result;
    web->context = ws_server_context(web->server);
    return handler_starts(web, err);
}

static void release(struct web *web) {
    ws_server_destroy(&web->server);
    if (web->pool)
        request_pool_destroy(&web->pool);
    host_check_destroy(&web->hosts);
    tls_files_destroy(&web->tls_files);
    rate_limits_destroy(&web->limits);
    guests_destroy(&web->guests);
    free(web);
}

static void share_places(struct web *web, int outgoing) {
    int wanted = WEB_CONNECTIONS_MAX + outgoing;
    int places = ws_server_places(wanted, WEB_CONNECTIONS_SPARE, &web->spare);
    web->outgoing = places * outgoing / wanted;
    web->places = places - web->outgoing;
}

static enum result read_server_certificate(struct web *web, const struct web_config *config,
                                           struct error *err) {
    enum result result = host_check_create(config->certificate, config->names, &web->hosts, err);
    if (result == RESULT_OK && config->certificate)
        result = tls_files_create(config->certificate, config->key, &web->tls_files, NULL, err);
    if (web->tls_files)
        atomic_store(&web->certificate_until_s, tls_files_end_s(web->tls_files));
    return result;
}

enum result web_create(const struct web_config *config, const struct web_handler *handler,
                       struct web **out_web, struct error *err) {
    struct web *web = alloc(1, sizeof *web);
    web->handler = *handler;
    web->pages = config->pages;
    web->timeout_s = config->timeout_s ? config->timeout_s : TIMEOUT_S;
    web->liveness.secs_since_valid_ping = (uint16_t)(web->timeout_s / 2);
    web->liveness.secs_since_valid_hangup = (uint16_t)web->timeout_s;
    web->limits = rate_limits_create();
    web->guests = guests_create();
    share_places(web, config->outgoing);
    *out_web = NULL;
    enum result result = read_server_certificate(web, config, err);
    if (result == RESULT_OK)
        result = listen_at(web, config, err);
    if (result != RESULT_OK) {
        release(web);
        return result;
    }
    web->pool = request_pool_create(handler, on_done, web);
    plan_renewal(web);
    *out_web = web; // before the thread runs: its handler may ask for it
    ws_server_start(web->server);
    return RESULT_OK;
}

void web_destroy(struct web **web) {
    struct web *w = *web;
    ws_server_stop(w->server);
    request_pool_stop(w->pool);
    release(w);
    *web = NULL;
}

int web_port(const struct web *web) {
    return ws_server_port(web->server);
}

void web_wake(struct web *web) {
    if (!atomic_exchange(&web->woken, true))
        ws_server_wake(web->server);
}

struct web_counts web_counts(const struct web *web) {
    struct web_counts counts = {.connections = atomic_load(&web->here),
                                .pages = atomic_load(&web->open_sockets),
                                .certificate_until_s = atomic_load(&web->certificate_until_s)};
    for (size_t i = 0; i < sizeof counts.answers / sizeof *counts.answers; i++)
        counts.answers[i] = atomic_load(&web->answers[i]);
    return counts;
}
