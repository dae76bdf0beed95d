#include "websocket/ws_server.h"

#include "base/check.h"
#include "base/listen.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <openssl/ssl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <uv.h>

#define GOODBYE_US (500 * LWS_US_PER_MS)
#define LOOK_AGAIN_US LWS_US_PER_SEC
#define LAST_TURNS 1000
#define WRITE_CLOSE ((enum lws_write_protocol)4) // libwebsockets' own name for it is not public
#define UNSENT_MAX 16384
#define ENOUGH_DESCRIPTORS 1024
#define SHARES 5 // stations, traces, browsers, the console, all else

struct ws_server {
    struct ws_server_handler handler;
    struct lws_context *context; // libwebsockets clears it once all of it is gone
    uv_loop_t loop;              // its sockets wait in epoll: a turn costs nothing for silent ones
    bool has_loop;
    SSL_CTX *no_client; // else libwebsockets makes one with all of the system's authorities
    int port;
    pthread_t thread;
    const char *name; // of the thread: a literal
    atomic_bool woken, stopping;
    // The thread's.
    bool stops, out_of_time;
    lws_sorted_usec_list_t goodbye, turn;
};

// ---- the thread ---------------------------------------------------------------------------------

static void on_goodbye_over(lws_sorted_usec_list_t *goodbye) {
    lws_container_of(goodbye, struct ws_server, goodbye)->out_of_time = true;
}

static void begin_to_stop(struct ws_server *server) {
    server->stops = true;
    lws_sul_schedule(server->context, 0, &server->goodbye, on_goodbye_over, GOODBYE_US);
    if (server->handler.on_stop)
        server->handler.on_stop(server->handler.user);
}

static bool is_over(const struct ws_server *server) {
    const struct ws_server_handler *h = &server->handler;
    return server->stops && (server->out_of_time || !h->is_empty || h->is_empty(h->user));
}

// libwebsockets goes on without the descriptor that wakes it, where the system gives none.
static void look_again(lws_sorted_usec_list_t *turn) {
    struct ws_server *server = lws_container_of(turn, struct ws_server, turn);
    lws_sul_schedule(server->context, 0, turn, look_again, LOOK_AGAIN_US);
}

// Of what libwebsockets has read ahead, libuv's turn hands out one part only.
static void take_turn(struct ws_server *server) {
    uv_run(&server->loop, UV_RUN_ONCE);
    if (!lws_service_adjust_timeout(server->context, 1, 0))
        lws_cancel_service(server->context);
}

static void *serve(void *argument) {
    struct ws_server *server = argument;
    const struct ws_server_handler *h = &server->handler;
    pthread_setname_np(pthread_self(), server->name);
    look_again(&server->turn);
    while (!is_over(server)) {
        take_turn(server);
        bool woken = atomic_exchange(&server->woken, false);
        if (atomic_load(&server->stopping) && !server->stops)
            begin_to_stop(server);
        if (woken && h->on_wake)
            h->on_wake(h->user);
        if (h->after_turn)
            h->after_turn(h->user);
    }
    return NULL;
}

void ws_server_start(struct ws_server *server) {
    NEED(pthread_create(&server->thread, NULL, serve, server) == 0, "thread");
}

void ws_server_wake(struct ws_server *server) {
    if (!atomic_exchange(&server->woken, true))
        lws_cancel_service(server->context);
}

bool ws_server_stops(const struct ws_server *server) {
    return server->stops || atomic_load(&server->stopping);
}

void ws_server_stop(struct ws_server *server) {
    atomic_store(&server->stopping, true);
    lws_cancel_service(server->context);
    pthread_join(server->thread, NULL);
}

// ---- listening ----------------------------------------------------------------------------------

static bool machine_has_ipv6(void) {
    int fd = socket(AF_INET6, SOCK_STREAM, 0);
    if (fd >= 0)
        close(fd);
    return fd >= 0;
}

static uint64_t options_of(enum ws_server_kind kind, const char *address) {
    uint64_t options = LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND |
                       LWS_SERVER_OPTION_EXPLICIT_VHOSTS | LWS_SERVER_OPTION_LIBUV;
    bool ipv6 = address ? strchr(address, ':') != NULL : machine_has_ipv6();
    if (kind == WS_SERVER_LOCAL)
        return options | LWS_SERVER_OPTION_UNIX_SOCK;
    if (kind == WS_SERVER_TLS)
        options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
    if (kind == WS_SERVER_RAW)
        options |= LWS_SERVER_OPTION_ADOPT_APPLY_LISTEN_ACCEPT_CONFIG;
    return options | (ipv6 ? 0 : LWS_SERVER_OPTION_DISABLE_IPV6);
}

static enum result fail_to_listen(enum ws_server_kind kind,
                                  const struct lws_context_creation_info *info, int reason,
                                  struct error *err) {
    if (kind == WS_SERVER_LOCAL)
        return fail(err, RESULT_IO, "%s: cannot listen: %s", info->iface, strerror(reason));
    if (listen_check(info->iface, info->port, err) != RESULT_OK)
        return RESULT_IO;
    return fail(err, RESULT_IO, "port %d: cannot listen%s%s", info->port,
                kind == WS_SERVER_TLS ? " with the certificate " : "",
                kind == WS_SERVER_TLS ? info->ssl_cert_filepath : "");
}

static void complete(struct ws_server *server, enum ws_server_kind kind,
                     struct lws_context_creation_info *info) {
    info->options = options_of(kind, info->iface);
    info->user = server->handler.user;
    info->pcontext = &server->context;
    info->provided_client_ssl_ctx = server->no_client;
    info->listen_accept_role = kind == WS_SERVER_RAW ? "raw-skt" : NULL;
    info->listen_accept_protocol = kind == WS_SERVER_RAW ? info->protocols[0].name : NULL;
    info->alpn = kind == WS_SERVER_TLS ? "http/1.1" : NULL;
    info->gid = -1;
    info->uid = -1;
}

// At its share a server accepts nobody until somebody has gone.
static unsigned int share_of_descriptors(unsigned int wanted) {
    struct rlimit limit;
    if (!wanted || getrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur >= ENOUGH_DESCRIPTORS)
        return wanted;
    unsigned int share = (unsigned int)limit.rlim_cur / SHARES;
    return share < wanted ? share : wanted;
}

int ws_server_places(int wanted, int spare, int *out_spare) {
    int share = (int)share_of_descriptors((unsigned int)(wanted + spare));
    *out_spare = share / 3 < spare ? share / 3 : spare;
    return share - *out_spare;
}

static enum result create_context(struct ws_server *server, struct lws_context_creation_info *info,
                                  struct error *err) {
    void *loops[] = {&server->loop};
    int failure = uv_loop_init(&server->loop);
    server->has_loop = failure == 0;
    if (failure)
        return fail(err, RESULT_IO, "cannot listen: %s", strerror(-failure));
    info->foreign_loops = loops;
    server->context = lws_create_context(info);
    return server->context
               ? RESULT_OK
               : fail(err, RESULT_IO,
                      "libwebsockets does not start: too few descriptors or too little memory are "
                      "left, or its part libwebsockets-evlib-uv is not installed");
}

enum result ws_server_create(enum ws_server_kind kind, const struct lws_context_creation_info *info,
                             const struct ws_server_handler *handler, struct ws_server **out_server,
                             struct error *err) {
    struct ws_server *server = alloc(1, sizeof *server);
    struct lws_context_creation_info whole = *info;
    whole.fd_limit_per_thread = share_of_descriptors(info->fd_limit_per_thread);
    server->handler = *handler;
    server->name = info->vhost_name;
    if (kind == WS_SERVER_TLS) {
        server->no_client = SSL_CTX_new(TLS_client_method());
        NEED(server->no_client, "memory");
    }
    complete(server, kind, &whole);
    lws_set_log_level(0, NULL);
    enum result result = create_context(server, &whole, err);
    struct lws_vhost *vhost =
        result == RESULT_OK ? lws_create_vhost(server->context, &whole) : NULL;
    if (result == RESULT_OK && !vhost)
        result = fail_to_listen(kind, &whole, errno, err);
    if (vhost)
        server->port = lws_get_vhost_listen_port(vhost);
    else
        ws_server_destroy(&server);
    *out_server = server;
    return result;
}

// Sockets are closed in turns of their loop, and the rest of the context behind them.
static void destroy_context(struct ws_server *server) {
    while (server->context) {
        lws_context_destroy(server->context);
        for (int left = LAST_TURNS; left > 0 && uv_run(&server->loop, UV_RUN_NOWAIT);)
            left--;
    }
    if (server->has_loop)
        uv_loop_close(&server->loop);
}

void ws_server_destroy(struct ws_server **server) {
    struct ws_server *s = *server;
    if (!s)
        return;
    destroy_context(s);
    SSL_CTX_free(s->no_client);
    free(s);
    *server = NULL;
}

int ws_server_port(const struct ws_server *server) {
    return server->port;
}

struct lws_context *ws_server_context(const struct ws_server *server) {
    return server->context;
}

static int say_close(struct lws *socket, int status) {
    uint8_t frame[LWS_PRE + 2], *bytes = frame + LWS_PRE;
    bytes[0] = (uint8_t)(status >> 8);
    bytes[1] = (uint8_t)status;
    return lws_write(socket, bytes, 2, WRITE_CLOSE) < 2 ? -1 : 0;
}

int ws_close(struct lws *socket, int status) {
    lws_set_timer_usecs(socket, LWS_USEC_PER_SEC);
    return say_close(socket, status);
}

int ws_closed(struct lws *socket, bool closes) {
    if (!closes)
        say_close(socket, LWS_CLOSE_STATUS_NORMAL);
    return ws_end(socket);
}

int ws_end(struct lws *socket) {
    lws_rx_flow_control(socket, 0);
    return -1;
}

void ws_keep_queue_short(struct lws *socket) {
    int fd = lws_get_socket_fd(socket), bytes = UNSENT_MAX, yes = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &bytes, sizeof bytes);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
}
