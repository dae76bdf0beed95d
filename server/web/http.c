#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"
#include "web/connection.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DROPPED_MAX (1 << 20) // of a body that is too large, but read to its end

// ---- headers ------------------------------------------------------------------------------------

// Empty if the header is missing. False if it is too long for `out`.
static bool header(struct lws *socket, enum lws_token_indexes token, char *out, size_t size) {
    if (lws_hdr_copy(socket, out, (int)size, token) >= 0)
        return true;
    out[0] = '\0';
    return false;
}

static void read_method(struct lws *socket, struct web_task *task, char **out_uri,
                        int *out_length) {
    static const char *const names[] = {
        [LWSHUMETH_GET] = "GET",     [LWSHUMETH_POST] = "POST",     [LWSHUMETH_PUT] = "PUT",
        [LWSHUMETH_PATCH] = "PATCH", [LWSHUMETH_DELETE] = "DELETE", [LWSHUMETH_HEAD] = "GET",
    };
    int method = lws_http_get_uri_and_method(socket, out_uri, out_length);
    const char *name =
        method >= 0 && method < (int)(sizeof names / sizeof *names) ? names[method] : NULL;
    snprintf(task->method, sizeof task->method, "%s", name ? name : "");
    task->options.head_only = method == LWSHUMETH_HEAD;
}

static bool read_path(struct web_task *task, const char *uri, int length) {
    if (length <= 0 || (size_t)length >= sizeof task->path || memchr(uri, '\0', (size_t)length))
        return false;
    memcpy(task->path, uri, (size_t)length);
    task->path[length] = '\0';
    return true;
}

// libwebsockets gives arguments one by one, and unescaped.
static bool read_query(struct lws *socket, struct web_task *task) {
    char argument[2048]; // the code of a sign-on may be long
    size_t used = 0;
    for (int i = 0; lws_hdr_fragment_length(socket, WSI_TOKEN_HTTP_URI_ARGS, i) > 0; i++) {
        int length =
            lws_hdr_copy_fragment(socket, argument, sizeof argument, WSI_TOKEN_HTTP_URI_ARGS, i);
        if (length < 0 || used + 3 * (size_t)length + 2 > sizeof task->query)
            return false;
        if (used > 0)
            task->query[used++] = '&';
        for (int j = 0; j < length; j++) {
            unsigned char c = (unsigned char)argument[j];
            bool plain = isalnum(c) || (c && strchr("-._~=", c));
            used += (size_t)sprintf(task->query + used, plain ? "%c" : "%%%02X", c);
        }
    }
    return true;
}

static void read_token(struct lws *socket, char out_token[WEB_TOKEN_MAX], bool *out_by_cookie) {
    char text[2048];
    out_token[0] = '\0';
    *out_by_cookie = false;
    if (header(socket, WSI_TOKEN_HTTP_AUTHORIZATION, text, sizeof text) &&
        token_of_authorization(text, out_token))
        return;
    *out_by_cookie = header(socket, WSI_TOKEN_HTTP_COOKIE, text, sizeof text) &&
                     token_of_cookies(text, out_token);
}

static bool is_passed_on(struct lws *socket) {
    char via[256];
    return header(socket, WSI_TOKEN_HTTP_VIA, via, sizeof via) && strstr(via, WEB_VIA);
}

// "gzip", but not "gzip;q=0".
static bool is_accepted(const char *accepted, const char *what) {
    const char *at = strstr(accepted, what);
    if (!at)
        return false;
    const char *weight = strstr(at, ";q=0"), *end = at + strcspn(at, ",");
    if (!weight || weight > end)
        return true;
    return weight[4] == '.' && strspn(weight + 5, "0") != strcspn(weight + 5, ",; ");
}

static void read_other_cookies(struct lws *socket, struct web_task *task) {
    char text[2048];
    task->device[0] = task->sign_on[0] = '\0';
    if (!header(socket, WSI_TOKEN_HTTP_COOKIE, text, sizeof text))
        return;
    token_of_device(text, task->device);
    token_of_sign_on(text, task->sign_on);
}

static bool takes_openmetrics(struct lws *socket) {
    char accepted[1024];
    return header(socket, WSI_TOKEN_HTTP_ACCEPT, accepted, sizeof accepted) &&
           is_accepted(accepted, "application/openmetrics-text");
}

static void read_options(struct lws *socket, struct answer_options *options) {
    char accepted[128];
    header(socket, WSI_TOKEN_HTTP_ACCEPT_ENCODING, accepted, sizeof accepted);
    options->takes_gzip = is_accepted(accepted, "gzip");
    header(socket, WSI_TOKEN_HTTP_RANGE, options->range, sizeof options->range);
    header(socket, WSI_TOKEN_HTTP_IF_RANGE, options->if_range, sizeof options->if_range);
    header(socket, WSI_TOKEN_HTTP_IF_NONE_MATCH, options->none_match, sizeof options->none_match);
}

// ---- checking -----------------------------------------------------------------------------------

// How long the body is; -1: it is not said, -2: it is not to be understood.
static int64_t read_length(struct lws *socket) {
    char text[24];
    int64_t length;
    if (lws_hdr_total_length(socket, WSI_TOKEN_HTTP_TRANSFER_ENCODING))
        return -2;
    if (!lws_hdr_total_length(socket, WSI_TOKEN_HTTP_CONTENT_LENGTH))
        return -1;
    if (!header(socket, WSI_TOKEN_HTTP_CONTENT_LENGTH, text, sizeof text) || !isdigit(text[0]) ||
        !number_int(text, 0, INT64_MAX, &length))
        return -2;
    return length;
}

static struct refusal check_length(const char *method, int64_t length) {
    if (length == -2)
        return (struct refusal){411, "length", "Content-Length must give the length of the body.",
                                true};
    if (length == -1 && strcmp(method, "GET") && strcmp(method, "DELETE"))
        return (struct refusal){411, "length", "Content-Length is missing.", true};
    if (length > WEB_BODY_MAX)
        return (struct refusal){413, "too_large", "A body has at most 65536 bytes.",
                                length > DROPPED_MAX};
    return (struct refusal){0};
}

static struct refusal check_host(const struct web_connection *c, char *out_host, size_t size) {
    if (!header(c->socket, WSI_TOKEN_HOST, out_host, size) || !out_host[0])
        return (struct refusal){400, "host", "Host is missing or too long.", false};
    if (!host_check_is_own(c->web->hosts, out_host))
        return (struct refusal){421, "host", "This server does not have this name ([web] names).",
                                false};
    return (struct refusal){0};
}

// needed: refuse a request without Origin, because any site may have sent it.
static struct refusal check_origin(const struct web_connection *c, const char *host, bool needed) {
    char origin[300];
    bool fits = header(c->socket, WSI_TOKEN_ORIGIN, origin, sizeof origin);
    if (fits && (origin[0] ? host_check_is_origin(c->web->hosts, origin, host) : !needed))
        return (struct refusal){0};
    return (struct refusal){403, "origin", "Only pages of this server may send this request.",
                            false};
}

static struct refusal check_request(struct web_connection *c, struct web_task *task, int64_t length,
                                    bool readable) {
    struct refusal refusal = check_length(task->method, length);
    if (refusal.status)
        return refusal;
    if (!readable)
        return (struct refusal){400, "address", "The path or query is too long or malformed.",
                                false};
    refusal = check_host(c, task->host, sizeof task->host);
    if (refusal.status)
        return refusal;
    if (!task->method[0])
        return (struct refusal){405, "method", "This server does not support this method.", false};
    if (!strcmp(task->method, "GET"))
        return (struct refusal){0};
    return check_origin(c, task->host, task->by_cookie);
}

// ---- answering ----------------------------------------------------------------------------------

static int send_answer(struct web_connection *c, struct answer answer) {
    if (answer.status < 600) // another server may answer anything
        atomic_fetch_add(&c->web->answers[answer.status / 100], 1);
    log_debug("web", "%s %s %s: %d", c->address, c->task ? c->task->method : "",
              c->task ? c->task->path : "", answer.status);
    web_task_destroy(&c->task);
    c->answer = answer;
    c->head_sent = false;
    c->sent = 0;
    c->state = CONNECTION_SENDING;
    lws_set_timeout(c->socket, PENDING_TIMEOUT_HTTP_CONTENT, c->web->timeout_s);
    lws_callback_on_writable(c->socket);
    return 0;
}

static int refuse_request(struct web_connection *c, const struct refusal *r) {
    struct answer answer = answer_refusal(r->status, r->code, r->text, r->closes);
    if (c->task && c->task->options.head_only)
        answer.size = 0;
    return send_answer(c, answer);
}

static int serve_page(struct web_connection *c) {
    static const struct refusal no_method = {405, "method", "Pages support GET and HEAD only.",
                                             false};
    static const struct refusal no_page = {404, "not_found", "There is no such page.", false};
    static const struct refusal no_upgrade = {426, "websocket", "This path is for WebSockets.",
                                              false};
    const char *path = strcmp(c->task->path, "/") ? c->task->path : "/index.html";
    if (strcmp(c->task->method, "GET"))
        return refuse_request(c, &no_method);
    if (!strcmp(path, "/live"))
        return refuse_request(c, &no_upgrade);
    for (int i = 0; i < c->web->pages.count; i++)
        if (!strcmp(c->web->pages.pages[i].path, path))
            return send_answer(c, answer_page(&c->web->pages.pages[i], &c->task->options));
    return refuse_request(c, &no_page);
}

// While the pool have the task nothing is read, which in HTTP means that nothing is written.
static void pause_reading(struct web_connection *c) {
    c->away = true;
    lws_rx_flow_control(c->socket, 0);
    lws_set_timeout(c->socket, NO_PENDING_TIMEOUT, 0);
}

// Whose token it is decides, and the address where that is not known.
static bool may_request(struct web_connection *c, const char *token) {
    int64_t now_ns = clock_now_ns();
    struct guest *guest = token[0] ? guests_find(c->web->guests, token, now_ns) : NULL;
    if (!guest)
        return rate_limit_may_request(c->limit, token[0], now_ns);
    places_prove(c, guest);
    return guest_may_request(guest, now_ns);
}

static int add_request(struct web_connection *c) {
    static const struct refusal too_fast = {429, "too_fast", "Too many requests; wait a second.",
                                            false};
    static const struct refusal too_many = {503, "busy", "The server is too busy; try again.",
                                            false};
    if (!may_request(c, c->task->token))
        return refuse_request(c, &too_fast);
    if (!request_pool_add(c->web->pool, c->task))
        return refuse_request(c, &too_many);
    c->state = CONNECTION_WAITING;
    pause_reading(c);
    return 0;
}

// What monitors ask for where they expect it.
static void place_in_api(struct web_task *task) {
    static const char *const paths[] = {"/metrics", "/healthz", "/readyz"};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++)
        if (!strcmp(task->path, paths[i])) {
            snprintf(task->path, sizeof task->path, "/api/v1%s", paths[i]);
            return;
        }
}

// The request is whole.
static int dispatch(struct web_connection *c) {
    static const char api[] = "/api/v1/";
    lws_sul_cancel(&c->body_due);
    if (c->refusal.status)
        return refuse_request(c, &c->refusal);
    place_in_api(c->task);
    return strncmp(c->task->path, api, sizeof api - 1) ? serve_page(c) : add_request(c);
}

static void hang_up(struct web_connection *c) {
    lws_set_timeout(c->socket, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
}

static void on_body_due(lws_sorted_usec_list_t *due) {
    hang_up(lws_container_of(due, struct web_connection, body_due));
}

int http_begin(struct web_connection *c) {
    char *uri = NULL;
    int uri_length = 0;
    if (c->state != CONNECTION_IDLE)
        return -1;
    c->body_ended = false;
    struct web_task *task = c->task = web_task_create(WEB_TASK_REQUEST, c);
    read_method(c->socket, task, &uri, &uri_length);
    read_token(c->socket, task->token, &task->by_cookie);
    read_other_cookies(c->socket, task);
    read_options(c->socket, &task->options);
    task->options.over_tls = c->web->tls_files != NULL;
    task->is_passed_on = is_passed_on(c->socket);
    task->takes_openmetrics = takes_openmetrics(c->socket);
    memcpy(task->address, c->address, sizeof task->address);
    task->is_near = c->limit->source.near;
    bool readable = read_path(task, uri, uri_length) && read_query(c->socket, task);
    int64_t length = read_length(c->socket);
    c->refusal = check_request(c, task, length, readable);
    if (c->refusal.closes || length <= 0)
        return dispatch(c);
    c->state = CONNECTION_READING;
    if (!c->refusal.status)
        task->body = alloc((size_t)length + 1, 1);
    lws_sul_schedule(c->web->context, 0, &c->body_due, on_body_due,
                     c->web->timeout_s * LWS_USEC_PER_SEC);
    return 0;
}

int http_take_body(struct web_connection *c, const void *bytes, size_t size) {
    if (c->state != CONNECTION_READING || !c->task->body)
        return 0;
    if (size > WEB_BODY_MAX - c->task->size)
        return -1;
    memcpy(c->task->body + c->task->size, bytes, size);
    c->task->size += size;
    return 0;
}

int http_end_body(struct web_connection *c) {
    if (c->body_ended) // bytes follow before the answer, which libwebsockets cannot handle
        return -1;
    c->body_ended = true;
    return c->state == CONNECTION_READING ? dispatch(c) : 0;
}

// A slow download keeps its connection for long. False: this person has as many as they may.
static bool begin_download(struct web_connection *c, const char *downloader) {
    struct web_connection **place = NULL;
    int own = 0;
    for (int i = 0; i < WEB_DOWNLOADS_MAX; i++) {
        struct web_connection **at = &c->web->downloads[i];
        if (!*at)
            place = at;
        else
            own += !strcmp((*at)->downloader, downloader);
    }
    if (!place || own >= WEB_DOWNLOADS_OWN)
        return false;
    *place = c;
    snprintf(c->downloader, sizeof c->downloader, "%s", downloader);
    return true;
}

static void end_download(struct web_connection *c) {
    for (int i = 0; c->downloader[0] && i < WEB_DOWNLOADS_MAX; i++)
        if (c->web->downloads[i] == c)
            c->web->downloads[i] = NULL;
    c->downloader[0] = '\0';
}

static void answer_task(struct web_connection *c, struct web_task *task, struct answer answer) {
    bool is_file = answer.file >= 0 && answer.left > 0 && task->downloader[0];
    if (is_file && !begin_download(c, task->downloader)) {
        answer_release(&answer);
        answer = answer_refusal(503, "busy", "You have too many downloads; wait for one.", false);
    }
    send_answer(c, answer);
}

static void learn_of_request(struct web_connection *c, const struct web_task *task, int status) {
    if (task->token[0] && task->account.name[0])
        places_prove(c, guests_enter(c->web->guests, task->token, &task->account, clock_now_ns()));
    else if (task->token[0] && status == 401)
        guests_forget(c->web->guests, task->token);
}

void http_task_done(struct web_connection *c, struct web_task *task) {
    struct answer answer = task->answer;
    task->answer = answer_none();
    lws_rx_flow_control(c->socket, 1);
    if (task->kind == WEB_TASK_REQUEST) {
        learn_of_request(c, task, answer.status);
        answer_task(c, task, answer);
        return;
    }
    c->task = NULL;
    c->answer = answer;
    c->sent = 0;
    lws_set_timeout(c->socket, PENDING_TIMEOUT_HTTP_CONTENT, c->web->timeout_s);
    if (task->failed) // the answer has begun, so closing is the only way to signal the error
        hang_up(c);
    else
        lws_callback_on_writable(c->socket);
    web_task_destroy(&task);
}

// ---- sending ------------------------------------------------------------------------------------

static int finish_response(struct web_connection *c) {
    bool closes = c->answer.closes;
    end_download(c);
    answer_release(&c->answer);
    c->state = CONNECTION_IDLE;
    if (closes)
        return -1;
    return lws_http_transaction_completed(c->socket) ? -1 : 0;
}

static int read_on(struct web_connection *c) {
    c->task = web_task_create(WEB_TASK_FILE, c);
    c->task->answer = c->answer;
    c->answer = answer_none();
    if (!request_pool_add(c->web->pool, c->task))
        return -1;
    pause_reading(c);
    return 0;
}

// Head and first bytes together, then piece by piece. Behind the last one the next request may come
// at once.
int http_write(struct web_connection *c) {
    if (c->state != CONNECTION_SENDING || c->away)
        return 0;
    uint8_t *out = c->web->bytes;
    size_t head = c->head_sent ? 0 : c->answer.head_size, size = c->answer.size - c->sent;
    if (size > WEB_PIECE)
        size = WEB_PIECE;
    memcpy(out, c->answer.head, head);
    if (size > 0)
        memcpy(out + head, c->answer.bytes + c->sent, size);
    c->head_sent = true;
    c->sent += size;
    lws_set_timeout(c->socket, PENDING_TIMEOUT_HTTP_CONTENT, c->web->timeout_s);
    if (head + size > 0 &&
        lws_write(c->socket, out, head + size, LWS_WRITE_HTTP) < (int)(head + size))
        return -1;
    if (c->sent == c->answer.size && c->answer.left == 0)
        return finish_response(c);
    if (c->sent == c->answer.size)
        return read_on(c);
    lws_callback_on_writable(c->socket);
    return 0;
}

void http_end(struct web_connection *c) {
    end_download(c);
    lws_sul_cancel(&c->body_due);
    if (c->away)
        c->task->owner = NULL; // the pool have it
    else
        web_task_destroy(&c->task);
    answer_release(&c->answer);
}

// ---- upgrading ----------------------------------------------------------------------------------

static struct refusal check_upgrade(struct web_connection *c, const char *protocol,
                                    char *out_token) {
    char host[WEB_HOST_MAX], subprotocol[64], *uri;
    bool by_cookie;
    int length;
    struct refusal refusal = check_host(c, host, sizeof host);
    if (refusal.status)
        return refusal;
    read_token(c->socket, out_token, &by_cookie);
    refusal = check_origin(c, host, by_cookie);
    if (refusal.status)
        return refusal;
    if (strcasecmp(protocol, "websocket") ||
        lws_http_get_uri_and_method(c->socket, &uri, &length) != LWSHUMETH_GET || length != 5 ||
        memcmp(uri, "/live", 5))
        return (struct refusal){404, "not_found", "The only WebSocket is /live.", true};
    if (!header(c->socket, WSI_TOKEN_PROTOCOL, subprotocol, sizeof subprotocol) ||
        strcmp(subprotocol, WIRE_LIVE_SUBPROTOCOL))
        return (struct refusal){400, "subprotocol", "The subprotocol is " WIRE_LIVE_SUBPROTOCOL ".",
                                true};
    if (!out_token[0])
        return (struct refusal){401, "signed_out", "Sign in first.", true};
    if (!may_request(c, out_token))
        return (struct refusal){429, "too_fast", "Too many requests; wait a second.", true};
    if (live_is_full(c->web) || ws_server_stops(c->web->server))
        return (struct refusal){503, "full", "Too many pages are open.", true};
    return (struct refusal){0};
}

int http_upgrade(struct web_connection *c, const char *protocol) {
    char token[WEB_TOKEN_MAX];
    struct refusal refusal = check_upgrade(c, protocol, token);
    if (!refusal.status) {
        c->live = alloc(1, sizeof *c->live);
        memcpy(c->live->token, token, sizeof token);
        return 0;
    }
    uint8_t *out = c->web->bytes;
    struct answer a = answer_refusal(refusal.status, refusal.code, refusal.text, true);
    memcpy(out, a.head, a.head_size);
    memcpy(out + a.head_size, a.bytes, a.size);
    int written = lws_write(c->socket, out, a.head_size + a.size, LWS_WRITE_HTTP);
    answer_release(&a);
    return written < 0 ? -1 : 1;
}
