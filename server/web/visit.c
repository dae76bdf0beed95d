#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"
#include "web/web_parts.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DROPPED_MAX (1 << 20) // of a body that is too large, but read to its end

// ---- headers ------------------------------------------------------------------------------------

// Empty where it was not sent; false where it is too long for `out`.
static bool header(struct lws *socket, enum lws_token_indexes token, char *out, size_t size) {
    if (lws_hdr_copy(socket, out, (int)size, token) >= 0)
        return true;
    out[0] = '\0';
    return false;
}

static void read_method(struct lws *socket, struct job *job, char **out_uri, int *out_length) {
    static const char *const names[] = {
        [LWSHUMETH_GET] = "GET",     [LWSHUMETH_POST] = "POST",     [LWSHUMETH_PUT] = "PUT",
        [LWSHUMETH_PATCH] = "PATCH", [LWSHUMETH_DELETE] = "DELETE", [LWSHUMETH_HEAD] = "GET",
    };
    int method = lws_http_get_uri_and_method(socket, out_uri, out_length);
    const char *name =
        method >= 0 && method < (int)(sizeof names / sizeof *names) ? names[method] : NULL;
    snprintf(job->method, sizeof job->method, "%s", name ? name : "");
    job->wishes.head_only = method == LWSHUMETH_HEAD;
}

static bool read_path(struct job *job, const char *uri, int length) {
    if (length <= 0 || (size_t)length >= sizeof job->path || memchr(uri, '\0', (size_t)length))
        return false;
    memcpy(job->path, uri, (size_t)length);
    job->path[length] = '\0';
    return true;
}

// libwebsockets gives arguments one by one, and unescaped.
static bool read_query(struct lws *socket, struct job *job) {
    char argument[512];
    size_t used = 0;
    for (int i = 0; lws_hdr_fragment_length(socket, WSI_TOKEN_HTTP_URI_ARGS, i) > 0; i++) {
        int length =
            lws_hdr_copy_fragment(socket, argument, sizeof argument, WSI_TOKEN_HTTP_URI_ARGS, i);
        if (length < 0 || used + 3 * (size_t)length + 2 > sizeof job->query)
            return false;
        if (used > 0)
            job->query[used++] = '&';
        for (int j = 0; j < length; j++) {
            unsigned char c = (unsigned char)argument[j];
            bool plain = isalnum(c) || (c && strchr("-._~=", c));
            used += (size_t)sprintf(job->query + used, plain ? "%c" : "%%%02X", c);
        }
    }
    return true;
}

static void read_token(struct lws *socket, char out_token[DOOR_TOKEN_MAX], bool *out_by_cookie) {
    char text[2048];
    out_token[0] = '\0';
    *out_by_cookie = false;
    if (header(socket, WSI_TOKEN_HTTP_AUTHORIZATION, text, sizeof text) &&
        door_token_of_authorization(text, out_token))
        return;
    *out_by_cookie = header(socket, WSI_TOKEN_HTTP_COOKIE, text, sizeof text) &&
                     door_token_of_cookies(text, out_token);
}

// "gzip", but not "gzip;q=0".
static bool takes_gzip(const char *accepted) {
    const char *at = strstr(accepted, "gzip");
    if (!at)
        return false;
    at += strcspn(at, ";,");
    return strncmp(at, ";q=0", 4) || (at[4] == '.' && strspn(at + 5, "0") != strcspn(at + 5, ", "));
}

static void read_wishes(struct lws *socket, struct wishes *wishes) {
    char accepted[128];
    header(socket, WSI_TOKEN_HTTP_ACCEPT_ENCODING, accepted, sizeof accepted);
    wishes->takes_gzip = takes_gzip(accepted);
    header(socket, WSI_TOKEN_HTTP_RANGE, wishes->range, sizeof wishes->range);
    header(socket, WSI_TOKEN_HTTP_IF_RANGE, wishes->if_range, sizeof wishes->if_range);
    header(socket, WSI_TOKEN_HTTP_IF_NONE_MATCH, wishes->none_match, sizeof wishes->none_match);
}

// ---- judging ------------------------------------------------------------------------------------

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

static struct refusal judge_length(const char *method, int64_t length) {
    if (length == -2)
        return (struct refusal){411, "length", "a body's length in bytes must be said", true};
    if (length == -1 && strcmp(method, "GET") && strcmp(method, "DELETE"))
        return (struct refusal){411, "length", "Content-Length is missing", true};
    if (length > WEB_BODY_MAX)
        return (struct refusal){413, "too_large", "a body has at most 65536 bytes",
                                length > DROPPED_MAX};
    return (struct refusal){0};
}

static struct refusal judge_host(const struct visitor *v, char *out_host, size_t size) {
    if (!header(v->socket, WSI_TOKEN_HOST, out_host, size) || !out_host[0])
        return (struct refusal){400, "host", "Host is missing or too long", false};
    if (!door_is_own_host(v->web->door, out_host))
        return (struct refusal){421, "host", "this server has no such name ([web] names)", false};
    return (struct refusal){0};
}

// `needed`: who does not say where it comes from may be a page of anywhere.
static struct refusal judge_origin(const struct visitor *v, const char *host, bool needed) {
    char origin[300];
    bool fits = header(v->socket, WSI_TOKEN_ORIGIN, origin, sizeof origin);
    if (fits && (origin[0] ? door_is_origin_of(origin, host) : !needed))
        return (struct refusal){0};
    return (struct refusal){403, "origin", "only pages of this server may ask for that", false};
}

static struct refusal judge(struct visitor *v, struct job *job, int64_t length, bool readable) {
    char host[300];
    struct refusal refusal = judge_length(job->method, length);
    if (refusal.status)
        return refusal;
    if (!readable)
        return (struct refusal){400, "address", "the address is too long or malformed", false};
    refusal = judge_host(v, host, sizeof host);
    if (refusal.status)
        return refusal;
    if (!job->method[0])
        return (struct refusal){405, "method", "there is no such method here", false};
    if (!strcmp(job->method, "GET"))
        return (struct refusal){0};
    return judge_origin(v, host, job->by_cookie);
}

// ---- answering ----------------------------------------------------------------------------------

static int send_answer(struct visitor *v, struct answer answer) {
    log_debug("web", "%s %s %s: %d", v->address, v->job ? v->job->method : "",
              v->job ? v->job->path : "", answer.status);
    job_destroy(&v->job);
    v->answer = answer;
    v->head_sent = false;
    v->sent = 0;
    v->state = VISIT_SENDING;
    lws_set_timeout(v->socket, PENDING_TIMEOUT_HTTP_CONTENT, v->web->patience_s);
    lws_callback_on_writable(v->socket);
    return 0;
}

static int refuse(struct visitor *v, const struct refusal *r) {
    struct answer answer = answer_refusal(r->status, r->code, r->text, r->closes);
    if (v->job && v->job->wishes.head_only)
        answer.size = 0;
    return send_answer(v, answer);
}

static int serve_page(struct visitor *v) {
    static const struct refusal no_method = {405, "method", "pages are only read", false};
    static const struct refusal no_page = {404, "not_found", "there is no such page", false};
    static const struct refusal no_upgrade = {426, "websocket", "this is for WebSockets", false};
    const char *path = strcmp(v->job->path, "/") ? v->job->path : "/index.html";
    if (strcmp(v->job->method, "GET"))
        return refuse(v, &no_method);
    if (!strcmp(path, "/live"))
        return refuse(v, &no_upgrade);
    for (int i = 0; i < v->web->pages.count; i++)
        if (!strcmp(v->web->pages.pages[i].path, path))
            return send_answer(v, answer_page(&v->web->pages.pages[i], &v->job->wishes));
    return refuse(v, &no_page);
}

// While the clerks have the job nothing is read, which in HTTP means that nothing is written.
static void set_away(struct visitor *v) {
    v->away = true;
    lws_rx_flow_control(v->socket, 0);
    lws_set_timeout(v->socket, NO_PENDING_TIMEOUT, 0);
}

static int ask_clerks(struct visitor *v) {
    static const struct refusal too_fast = {429, "too_fast", "too many requests", false};
    static const struct refusal too_many = {503, "busy", "the server has too much to do", false};
    if (!guest_may_ask(v->guest, clock_now_ns()))
        return refuse(v, &too_fast);
    if (!clerks_give(v->web->clerks, v->job))
        return refuse(v, &too_many);
    v->state = VISIT_WAITING;
    set_away(v);
    return 0;
}

// The request is whole.
static int dispatch(struct visitor *v) {
    static const char api[] = "/api/v1/";
    lws_sul_cancel(&v->body_due);
    if (v->refusal.status)
        return refuse(v, &v->refusal);
    return strncmp(v->job->path, api, sizeof api - 1) ? serve_page(v) : ask_clerks(v);
}

static void hang_up(struct visitor *v) {
    lws_set_timeout(v->socket, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
}

static void on_body_due(lws_sorted_usec_list_t *due) {
    hang_up(lws_container_of(due, struct visitor, body_due));
}

int visit_begin(struct visitor *v) {
    char *uri = NULL;
    int uri_length = 0;
    if (v->state != VISIT_IDLE)
        return -1;
    v->heard = false;
    struct job *job = v->job = job_create(JOB_REQUEST, v);
    read_method(v->socket, job, &uri, &uri_length);
    read_token(v->socket, job->token, &job->by_cookie);
    read_wishes(v->socket, &job->wishes);
    memcpy(job->address, v->address, sizeof job->address);
    bool readable = read_path(job, uri, uri_length) && read_query(v->socket, job);
    int64_t length = read_length(v->socket);
    v->refusal = judge(v, job, length, readable);
    if (v->refusal.closes || length <= 0)
        return dispatch(v);
    v->state = VISIT_READING;
    if (!v->refusal.status)
        job->body = alloc((size_t)length + 1, 1);
    lws_sul_schedule(v->web->context, 0, &v->body_due, on_body_due,
                     v->web->patience_s * LWS_USEC_PER_SEC);
    return 0;
}

int visit_hear(struct visitor *v, const void *bytes, size_t size) {
    if (v->state != VISIT_READING || !v->job->body)
        return 0;
    if (size > WEB_BODY_MAX - v->job->size)
        return -1;
    memcpy(v->job->body + v->job->size, bytes, size);
    v->job->size += size;
    return 0;
}

int visit_heard(struct visitor *v) {
    if (v->heard) // of what is behind the body, before it was answered: libwebsockets cannot
        return -1;
    v->heard = true;
    return v->state == VISIT_READING ? dispatch(v) : 0;
}

void visit_answered(struct visitor *v, struct job *job) {
    struct answer answer = job->answer;
    job->answer = answer_none();
    lws_rx_flow_control(v->socket, 1);
    if (job->kind == JOB_REQUEST) {
        send_answer(v, answer);
        return;
    }
    v->job = NULL;
    v->answer = answer;
    v->sent = 0;
    lws_set_timeout(v->socket, PENDING_TIMEOUT_HTTP_CONTENT, v->web->patience_s);
    if (job->failed) // in the middle of the answer: there is no other way to tell
        hang_up(v);
    else
        lws_callback_on_writable(v->socket);
    job_destroy(&job);
}

// ---- sending ------------------------------------------------------------------------------------

static int finish(struct visitor *v) {
    bool closes = v->answer.closes;
    answer_release(&v->answer);
    v->state = VISIT_IDLE;
    if (closes)
        return -1;
    return lws_http_transaction_completed(v->socket) ? -1 : 0;
}

static int read_on(struct visitor *v) {
    v->job = job_create(JOB_READ, v);
    v->job->answer = v->answer;
    v->answer = answer_none();
    clerks_give(v->web->clerks, v->job);
    set_away(v);
    return 0;
}

// Head and first bytes together, then piece by piece. Behind the last one the next request may come
// at once.
int visit_write(struct visitor *v) {
    if (v->state != VISIT_SENDING || v->away)
        return 0;
    uint8_t *out = v->web->bytes;
    size_t head = v->head_sent ? 0 : v->answer.head_size, size = v->answer.size - v->sent;
    if (size > WEB_PIECE)
        size = WEB_PIECE;
    memcpy(out, v->answer.head, head);
    if (size > 0)
        memcpy(out + head, v->answer.bytes + v->sent, size);
    v->head_sent = true;
    v->sent += size;
    lws_set_timeout(v->socket, PENDING_TIMEOUT_HTTP_CONTENT, v->web->patience_s);
    if (head + size > 0 &&
        lws_write(v->socket, out, head + size, LWS_WRITE_HTTP) < (int)(head + size))
        return -1;
    if (v->sent == v->answer.size && v->answer.left == 0)
        return finish(v);
    if (v->sent == v->answer.size)
        return read_on(v);
    lws_callback_on_writable(v->socket);
    return 0;
}

void visit_end(struct visitor *v) {
    lws_sul_cancel(&v->body_due);
    if (v->away)
        v->job->owner = NULL; // the clerks have it
    else
        job_destroy(&v->job);
    answer_release(&v->answer);
}

// ---- upgrading ----------------------------------------------------------------------------------

static struct refusal judge_upgrade(struct visitor *v, const char *protocol, char *out_token) {
    char host[300], subprotocol[64], *uri;
    bool by_cookie;
    int length;
    struct refusal refusal = judge_host(v, host, sizeof host);
    if (refusal.status)
        return refusal;
    read_token(v->socket, out_token, &by_cookie);
    refusal = judge_origin(v, host, by_cookie);
    if (refusal.status)
        return refusal;
    if (strcasecmp(protocol, "websocket") ||
        lws_http_get_uri_and_method(v->socket, &uri, &length) != LWSHUMETH_GET || length != 5 ||
        memcmp(uri, "/live", 5))
        return (struct refusal){404, "not_found", "/live is the only WebSocket", true};
    if (!header(v->socket, WSI_TOKEN_PROTOCOL, subprotocol, sizeof subprotocol) ||
        strcmp(subprotocol, WIRE_LIVE_SUBPROTOCOL))
        return (struct refusal){400, "subprotocol", "only " WIRE_LIVE_SUBPROTOCOL " is spoken",
                                true};
    if (!out_token[0])
        return (struct refusal){401, "signed_out", "who is it?", true};
    if (!guest_may_ask(v->guest, clock_now_ns()))
        return (struct refusal){429, "too_fast", "too many requests", true};
    if (live_is_full(v->web) || v->web->draining)
        return (struct refusal){503, "full", "too many viewers", true};
    return (struct refusal){0};
}

int visit_upgrade(struct visitor *v, const char *protocol) {
    char token[DOOR_TOKEN_MAX];
    struct refusal refusal = judge_upgrade(v, protocol, token);
    if (!refusal.status) {
        v->viewer = alloc(1, sizeof *v->viewer);
        memcpy(v->viewer->token, token, sizeof token);
        return 0;
    }
    uint8_t *out = v->web->bytes;
    struct answer a = answer_refusal(refusal.status, refusal.code, refusal.text, true);
    memcpy(out, a.head, a.head_size);
    memcpy(out + a.head_size, a.bytes, a.size);
    int written = lws_write(v->socket, out, a.head_size + a.size, LWS_WRITE_HTTP);
    answer_release(&a);
    return written < 0 ? -1 : 1;
}
