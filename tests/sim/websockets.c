// The functions of libwebsockets and libuv that the rooms call, over streams in virtual time: no
// TLS, no frames; a message arrives whole and in order, or its stream ends. The libraries
// themselves are not linked.
#include "base/check.h"
#include "base/clock.h"
#include "net/identity.h"
#include "sim/net.h"
#include "sim/streams.h"

#include <libwebsockets.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <uv.h>

#define TIMERS_MAX 8
#define CONNECT_NS (5 * NS_PER_S)

struct lws_vhost {
    int port;
};

struct lws_context {
    struct lws_context *next;
    struct sim_process *process;
    const struct lws_protocols *protocols;
    void *user;
    void *loop;                   // of libuv; NULL: it has none
    struct lws_context **cleared; // at its end; NULL: none
    struct lws_vhost listens;     // port 0: a client's
    bool cancelled;
    lws_sorted_usec_list_t *timers[TIMERS_MAX];
    struct lws *first;
};

struct lws {
    struct lws *next;
    struct lws_context *context;
    const struct lws_protocols *protocol;
    void *user;
    struct stream *stream; // NULL while it connects
    bool server, fresh, failed, established, wants_write, kill, holds, comes;
    int fd;
    int64_t timer_ns; // INT64_MAX: none
    char name[64];    // protocol's
};

static struct lws_context *contexts;
static int next_fd;

static int64_t us_from_now(lws_usec_t us) {
    return sim_now_ns() + us * 1000;
}

void streams_begin(void) {
    contexts = NULL;
    next_fd = 2 * SIM_FD;
}

static void stir(struct lws_context *context) {
    sim_wake(context);
}

// ---- contexts -----------------------------------------------------------------------------------

struct lws_context *lws_create_context(const struct lws_context_creation_info *info) {
    struct lws_context *context = alloc(1, sizeof *context);
    context->process = sim_process();
    context->protocols = info->protocols;
    context->user = info->user;
    context->loop = info->foreign_loops ? info->foreign_loops[0] : NULL;
    context->cleared = info->pcontext;
    context->next = contexts;
    contexts = context;
    return context;
}

struct lws_vhost *lws_create_vhost(struct lws_context *context,
                                   const struct lws_context_creation_info *info) {
    context->listens.port = info->port ? info->port : 4700;
    return &context->listens;
}

int lws_get_vhost_listen_port(struct lws_vhost *vhost) {
    return vhost->port;
}

static void close_wsi(struct lws *wsi);

void lws_context_destroy(struct lws_context *context) {
    while (context->first)
        close_wsi(context->first);
    struct lws_context **at = &contexts;
    while (*at != context)
        at = &(*at)->next;
    *at = context->next;
    if (context->cleared)
        *context->cleared = NULL;
    free(context);
}

void lws_set_log_level(int level, void (*emit)(int level, const char *line)) {
    (void)level, (void)emit;
}

void lws_cancel_service(struct lws_context *context) {
    context->cancelled = true;
    stir(context);
}

void *lws_context_user(struct lws_context *context) {
    return context->user;
}

// ---- timers of a context ------------------------------------------------------------------------

void lws_sul_schedule(struct lws_context *context, int thread, lws_sorted_usec_list_t *timer,
                      sul_cb_t run, lws_usec_t us) {
    (void)thread;
    int free_place = -1;
    for (int i = 0; i < TIMERS_MAX; i++) {
        if (context->timers[i] == timer)
            context->timers[i] = NULL;
        if (!context->timers[i])
            free_place = i;
    }
    CHECK(free_place >= 0);
    timer->cb = run;
    timer->us = us_from_now(us) / 1000;
    if (us >= 0)
        context->timers[free_place] = timer;
    stir(context);
}

void lws_sul_cancel(lws_sorted_usec_list_t *timer) {
    for (struct lws_context *c = contexts; c; c = c->next)
        for (int i = 0; i < TIMERS_MAX; i++)
            if (c->timers[i] == timer)
                c->timers[i] = NULL;
}

int lws_retry_sul_schedule(struct lws_context *context, int thread, lws_sorted_usec_list_t *timer,
                           const lws_retry_bo_t *retry, sul_cb_t run, uint16_t *tries) {
    int last = retry->retry_ms_table_count - 1;
    uint64_t ms = retry->retry_ms_table[*tries < last ? *tries : last];
    ms += random_bits(sim_random()) % (ms * retry->jitter_percent / 100 + 1);
    (*tries)++;
    lws_sul_schedule(context, thread, timer, run, (lws_usec_t)ms * 1000);
    return 0;
}

// ---- connections --------------------------------------------------------------------------------

static struct lws *add_wsi(struct lws_context *context, const struct lws_protocols *protocol) {
    struct lws *wsi = alloc(1, sizeof *wsi);
    wsi->context = context;
    wsi->protocol = protocol;
    wsi->timer_ns = INT64_MAX;
    wsi->fd = next_fd++;
    wsi->user = protocol && protocol->per_session_data_size
                    ? alloc(1, protocol->per_session_data_size)
                    : NULL;
    struct lws **end = &context->first;
    while (*end)
        end = &(*end)->next;
    *end = wsi;
    return wsi;
}

static int tell(struct lws *wsi, enum lws_callback_reasons reason, void *bytes, size_t size) {
    return wsi->protocol->callback(wsi, reason, wsi->user, bytes, size);
}

// What is not yet, or no more, of a protocol goes to the first one.
static int tell_first(struct lws *wsi, enum lws_callback_reasons reason, void *bytes) {
    return wsi->context->protocols->callback(wsi, reason, NULL, bytes, 0);
}

static void close_wsi(struct lws *wsi) {
    struct lws **at = &wsi->context->first;
    while (*at != wsi)
        at = &(*at)->next;
    *at = wsi->next;
    if (wsi->server && wsi->established)
        tell(wsi, LWS_CALLBACK_CLOSED, NULL, 0);
    if (wsi->stream)
        stream_close(&wsi->stream);
    tell_first(wsi, LWS_CALLBACK_WSI_DESTROY, NULL);
    free(wsi->user);
    free(wsi);
}

static const struct lws_protocols *protocol_named(const struct lws_context *context,
                                                  const char *name) {
    for (const struct lws_protocols *p = context->protocols; p->name; p++)
        if (!strcmp(p->name, name))
            return p;
    return NULL;
}

static struct lws_context *listener(void) {
    for (struct lws_context *c = contexts; c; c = c->next)
        if (c->listens.port && !c->process->dead)
            return c;
    return NULL;
}

// The client may have gone meanwhile: it is looked for.
struct attempt {
    struct sim_process *process;
    int64_t incarnation;
    struct lws *wsi;
};

static struct lws *still_there(const struct attempt *attempt) {
    if (attempt->process->dead || attempt->process->incarnation != attempt->incarnation)
        return NULL;
    for (struct lws_context *c = contexts; c; c = c->next)
        for (struct lws *wsi = c->first; wsi; wsi = wsi->next)
            if (wsi == attempt->wsi)
                return wsi;
    return NULL;
}

static void finish_connecting(void *user) {
    struct attempt attempt = *(struct attempt *)user;
    free(user);
    struct lws *client = still_there(&attempt);
    if (!client || client->stream)
        return;
    struct lws_context *there = listener();
    int station = attempt.process->index;
    const struct weather *w = net_weather(station);
    if (!there || w->cut[TO_SERVER] || w->cut[TO_STATION]) {
        client->failed = true;
    } else {
        struct lws *server = add_wsi(there, protocol_named(there, client->name));
        CHECK(server->protocol);
        server->server = true;
        streams_pair(station, &client->stream, client->context, &server->stream, there);
        client->fresh = server->fresh = true;
        server->comes = true;
        stir(there);
    }
    stir(client->context);
}

struct lws *lws_client_connect_via_info(const struct lws_client_connect_info *info) {
    struct lws *wsi = add_wsi(info->context, info->context->protocols);
    snprintf(wsi->name, sizeof wsi->name, "%s", info->protocol);
    if (info->pwsi)
        *info->pwsi = wsi;
    struct attempt *attempt = alloc(1, sizeof *attempt);
    *attempt = (struct attempt){sim_process(), sim_process()->incarnation, wsi};
    int station = sim_process()->index;
    const struct weather *w = net_weather(station);
    bool cut = w->cut[TO_SERVER] || w->cut[TO_STATION];
    int64_t delay_ns = cut ? CONNECT_NS : 6 * net_delay_ns(station) + 2 * NS_PER_MS;
    sim_at(sim_now_ns() + delay_ns, finish_connecting, attempt);
    return wsi;
}

struct lws_context *lws_get_context(const struct lws *wsi) {
    return wsi->context;
}

const struct lws_protocols *lws_get_protocol(struct lws *wsi) {
    return wsi->protocol;
}

lws_sockfd_type lws_get_socket_fd(struct lws *wsi) {
    return wsi->fd;
}

int lws_rx_flow_control(struct lws *wsi, int enable) {
    wsi->holds = !enable;
    stir(wsi->context);
    return 0;
}

int __wrap_shutdown(int fd, int how);
int __wrap_shutdown(int fd, int how) {
    (void)how;
    for (struct lws_context *c = contexts; c; c = c->next)
        for (struct lws *wsi = c->first; wsi; wsi = wsi->next)
            if (wsi->fd == fd) {
                wsi->kill = true;
                stir(c);
            }
    return 0;
}

size_t lws_remaining_packet_payload(struct lws *wsi) {
    (void)wsi;
    return 0;
}

int lws_is_final_fragment(struct lws *wsi) {
    (void)wsi;
    return 1;
}

int lws_frame_is_binary(struct lws *wsi) {
    (void)wsi;
    return 1;
}

void lws_close_reason(struct lws *wsi, enum lws_close_status status, unsigned char *text,
                      size_t size) {
    (void)wsi, (void)status, (void)text, (void)size;
}

int lws_callback_on_writable(struct lws *wsi) {
    wsi->wants_write = true;
    stir(wsi->context);
    return 0;
}

void lws_set_timer_usecs(struct lws *wsi, lws_usec_t us) {
    wsi->timer_ns = us < 0 ? INT64_MAX : us_from_now(us);
    stir(wsi->context);
}

void lws_set_timeout(struct lws *wsi, enum pending_timeout reason, int seconds) {
    (void)reason;
    if (seconds != LWS_TO_KILL_ASYNC)
        return; // until the other side's close frame, which comes at once
    wsi->kill = true;
    stir(wsi->context);
}

int lws_send_pipe_choked(struct lws *wsi) {
    (void)wsi;
    return 0;
}

int lws_write(struct lws *wsi, unsigned char *bytes, size_t size, enum lws_write_protocol kind) {
    if (kind > LWS_WRITE_BINARY) { // a close frame
        wsi->kill = true;
        stir(wsi->context);
    } else {
        stream_send(wsi->stream, bytes, size);
    }
    return (int)size;
}

// ---- service ------------------------------------------------------------------------------------

static bool run_timer(struct lws_context *context) {
    for (int i = 0; i < TIMERS_MAX; i++) {
        lws_sorted_usec_list_t *timer = context->timers[i];
        if (!timer || timer->us * 1000 > sim_now_ns())
            continue;
        context->timers[i] = NULL;
        timer->cb(timer);
        return true;
    }
    return false;
}

static bool tell_cancelled(struct lws_context *context) {
    struct lws nobody = {.context = context, .protocol = context->protocols};
    if (!context->cancelled)
        return false;
    context->cancelled = false;
    tell(&nobody, LWS_CALLBACK_EVENT_WAIT_CANCELLED, NULL, 0);
    return true;
}

// A new connection at the listener's door.
static int let_in(struct lws *wsi) {
    wsi->comes = false;
    if (tell_first(wsi, LWS_CALLBACK_FILTER_NETWORK_CONNECTION, (void *)(intptr_t)wsi->fd))
        return -1;
    return tell_first(wsi, LWS_CALLBACK_WSI_CREATE, NULL);
}

static int begin_wsi(struct lws *wsi) {
    wsi->fresh = false;
    wsi->established = true;
    return tell(wsi, wsi->server ? LWS_CALLBACK_ESTABLISHED : LWS_CALLBACK_CLIENT_ESTABLISHED, NULL,
                0);
}

static int fail_wsi(struct lws *wsi) {
    static char why[] = "connect failed";
    tell(wsi, LWS_CALLBACK_CLIENT_CONNECTION_ERROR, why, sizeof why - 1);
    return -1;
}

static int receive(struct lws *wsi, const struct message *message) {
    return tell(wsi, wsi->server ? LWS_CALLBACK_RECEIVE : LWS_CALLBACK_CLIENT_RECEIVE,
                (void *)message->bytes, message->size);
}

static int write_wsi(struct lws *wsi) {
    wsi->wants_write = false;
    return tell(wsi, wsi->server ? LWS_CALLBACK_SERVER_WRITEABLE : LWS_CALLBACK_CLIENT_WRITEABLE,
                NULL, 0);
}

static int time_wsi(struct lws *wsi) {
    wsi->timer_ns = INT64_MAX;
    return tell(wsi, LWS_CALLBACK_TIMER, NULL, 0);
}

// True where there was something to do: one thing at a time.
static bool serve_wsi(struct lws *wsi) {
    struct message *message = NULL;
    int end = 0;
    if (wsi->failed)
        end = fail_wsi(wsi);
    else if (wsi->kill)
        end = -1;
    else if (wsi->comes)
        end = let_in(wsi);
    else if (wsi->fresh)
        end = begin_wsi(wsi);
    else if (wsi->stream && !wsi->holds && (message = stream_take(wsi->stream)))
        end = receive(wsi, message);
    else if (wsi->stream && stream_is_over(wsi->stream))
        end = -1;
    else if (wsi->timer_ns <= sim_now_ns())
        end = time_wsi(wsi);
    else if (wsi->established && wsi->wants_write && stream_has_room(wsi->stream))
        end = write_wsi(wsi);
    else
        return false;
    free(message);
    if (end)
        close_wsi(wsi);
    return true;
}

static bool serve(struct lws_context *context) {
    if (tell_cancelled(context) || run_timer(context))
        return true;
    for (struct lws *wsi = context->first; wsi; wsi = wsi->next)
        if (serve_wsi(wsi))
            return true;
    return false;
}

static int64_t next_time(const struct lws_context *context) {
    int64_t next_ns = INT64_MAX;
    for (int i = 0; i < TIMERS_MAX; i++)
        if (context->timers[i] && context->timers[i]->us * 1000 < next_ns)
            next_ns = context->timers[i]->us * 1000;
    for (const struct lws *wsi = context->first; wsi; wsi = wsi->next)
        if (wsi->timer_ns < next_ns)
            next_ns = wsi->timer_ns;
    return next_ns;
}

int lws_service(struct lws_context *context, int ms) {
    (void)ms;
    while (!serve(context))
        sim_wait(context, next_time(context) == INT64_MAX ? INT64_MAX : next_time(context) + 1);
    return 0;
}

int uv_loop_init(uv_loop_t *loop) {
    (void)loop;
    return 0;
}

int uv_loop_close(uv_loop_t *loop) {
    (void)loop;
    return 0;
}

int uv_run(uv_loop_t *loop, uv_run_mode mode) {
    for (struct lws_context *context = contexts; context && mode == UV_RUN_ONCE;
         context = context->next)
        if (context->loop == loop)
            return lws_service(context, 0);
    return 0;
}

int lws_service_adjust_timeout(struct lws_context *context, int ms, int thread) {
    (void)context;
    (void)thread;
    return ms;
}

// ---- who is there -------------------------------------------------------------------------------

SSL *lws_get_ssl(struct lws *wsi) {
    return (SSL *)(void *)wsi;
}

void __wrap_identity_of(const struct ssl_st *connection, struct identity *out);
void __wrap_identity_of(const struct ssl_st *connection, struct identity *out) {
    const struct lws *wsi = (const void *)connection;
    *out = (struct identity){.certified = true, .until_s = INT64_C(1) << 40};
    snprintf(out->name, sizeof out->name, "room-%d", stream_station(wsi->stream) + 1);
    snprintf(out->serial, sizeof out->serial, "0%d", stream_station(wsi->stream) + 1);
}
