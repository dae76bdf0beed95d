#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "web/web_parts.h"

#include <stdlib.h>
#include <string.h>

#define RENEWAL_US LWS_USEC_PER_SEC // is the token still that account's?
#define MESSAGES_S 300              // of one page
#define MESSAGES_AT_ONCE 600
#define CLOSE_S 3 // for a browser to take the close frame

enum close_status {
    GOING_AWAY = 1001,
    NOT_BINARY = 1003,
    MALFORMED = 1007,
    NOT_ALLOWED = 1008,
    TOO_LONG = 1009,
    TRY_LATER = 1013
};

// ---- coming and going ---------------------------------------------------------------------------

static int find_slot(const struct web *web, const struct visitor *visitor) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->live[i] == visitor)
            return i;
    return -1;
}

bool live_is_full(const struct web *web) {
    return find_slot(web, NULL) < 0;
}

// From here on the handler does not know of it, and its place is free.
static void leave(struct visitor *v) {
    int slot = find_slot(v->web, v);
    if (slot >= 0)
        v->web->live[slot] = NULL;
    lws_sul_cancel(&v->viewer->due);
    lws_sul_cancel(&v->viewer->renewal);
    if (v->viewer->user)
        v->web->handler.on_left(v->web->handler.user, v->viewer->user);
    v->viewer->user = NULL;
}

static void close_with(struct visitor *v, enum close_status status) {
    if (v->viewer->closing)
        return;
    v->viewer->closing = (int)status;
    leave(v);
    lws_set_timeout(v->socket, PENDING_TIMEOUT_USER_OK, CLOSE_S);
    lws_callback_on_writable(v->socket);
}

// Nothing more will be said to it.
static void be_silent(struct visitor *v) {
    v->web->live_sockets -= v->viewer->open;
    v->viewer->open = false;
}

void live_end(struct visitor *v) {
    if (!v->viewer)
        return;
    be_silent(v);
    leave(v);
    free(v->viewer);
    v->viewer = NULL;
}

// ---- when there is something to do
// ----------------------------------------------------------------

static void on_due(lws_sorted_usec_list_t *due) {
    struct viewer *viewer = lws_container_of(due, struct viewer, due);
    lws_callback_on_writable(viewer->visitor->socket);
}

static bool takes_more(const struct viewer *viewer) {
    return viewer->user && viewer->sent - viewer->drawn < WEB_BATCHES_ON_WAY;
}

static void plan(struct visitor *v) {
    struct viewer *viewer = v->viewer;
    int64_t now_ns = clock_now_ns();
    lws_sul_cancel(&viewer->due);
    if (!takes_more(viewer))
        return;
    if (viewer->next_ns <= now_ns)
        lws_callback_on_writable(v->socket);
    else if (viewer->next_ns < INT64_MAX)
        lws_sul_schedule(v->web->context, 0, &viewer->due, on_due,
                         (viewer->next_ns - now_ns + 999) / 1000);
}

static void ask_now(struct visitor *v) {
    v->viewer->next_ns = 0;
    plan(v);
}

void live_wake(struct web *web) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->live[i])
            ask_now(web->live[i]);
}

void live_drain(struct web *web) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->live[i])
            close_with(web->live[i], GOING_AWAY);
}

// ---- who it is ----------------------------------------------------------------------------------

static void ask_who(struct visitor *v) {
    v->job = job_create(JOB_ENTER, v);
    memcpy(v->job->token, v->viewer->token, sizeof v->job->token);
    v->away = true;
    clerks_give(v->web->clerks, v->job);
}

static void on_renewal(lws_sorted_usec_list_t *renewal) {
    struct viewer *viewer = lws_container_of(renewal, struct viewer, renewal);
    ask_who(viewer->visitor);
}

int live_open(struct visitor *v) {
    int slot = find_slot(v->web, NULL);
    CHECK(v->viewer && !v->job && slot >= 0); // judged before the upgrade
    v->web->live[slot] = v;
    v->web->live_sockets++;
    v->viewer->open = true;
    v->state = VISIT_LIVE;
    v->viewer->visitor = v;
    v->viewer->next_ns = INT64_MAX;
    lws_rx_flow_control(v->socket, 0); // until it is known
    ask_who(v);
    return 0;
}

static bool is_same(const struct web_account *a, const struct web_account *b) {
    return !strcmp(a->name, b->name) && !strcmp(a->role, b->role) &&
           !strcmp(a->trainee, b->trainee);
}

static void let_in(struct visitor *v) {
    const struct web_handler *handler = &v->web->handler;
    v->viewer->user = handler->on_viewer(handler->user, &v->viewer->account);
    if (!v->viewer->user) {
        close_with(v, TRY_LATER);
        return;
    }
    lws_rx_flow_control(v->socket, 1);
    ask_now(v);
}

// 0: it may stay.
static int judge(const struct viewer *viewer, const struct job *job) {
    bool is_in = viewer->user;
    if (job->entry == RESULT_OK)
        return is_in && !is_same(&job->account, &viewer->account) ? NOT_ALLOWED : 0;
    if (job->entry == RESULT_MISSING)
        return NOT_ALLOWED;
    return is_in ? 0 : TRY_LATER;
}

void live_answered(struct visitor *v, struct job *job) {
    struct viewer *viewer = v->viewer;
    v->job = NULL;
    int status = judge(viewer, job);
    if (!viewer->user)
        viewer->account = job->account;
    job_destroy(&job);
    if (viewer->closing)
        return;
    if (status) {
        close_with(v, (enum close_status)status);
        return;
    }
    lws_sul_schedule(v->web->context, 0, &viewer->renewal, on_renewal, RENEWAL_US);
    if (!viewer->user)
        let_in(v);
}

// ---- what the page says -------------------------------------------------------------------------

static int refuse(struct visitor *v, enum close_status status, const char *text) {
    log_warning("web", "%s (%s): %s", v->address, v->viewer->account.name, text);
    v->viewer->closing = (int)status;
    leave(v);
    lws_close_reason(v->socket, (enum lws_close_status)status, NULL, 0);
    be_silent(v);
    return -1;
}

static int take_message(struct visitor *v) {
    const struct web_handler *handler = &v->web->handler;
    struct viewer *viewer = v->viewer;
    arthron_Page message;
    struct error err;
    if (!bucket_take(&viewer->messages, MESSAGES_S, MESSAGES_AT_ONCE, clock_now_ns()))
        return refuse(v, NOT_ALLOWED, "the page says too much");
    if (wire_decode_page(viewer->incoming, viewer->used, &message, &err) != RESULT_OK)
        return refuse(v, MALFORMED, err.text);
    if (message.which_message == arthron_Page_drawn_tag) {
        uint64_t drawn = message.message.drawn.batches;
        if (drawn > viewer->sent || drawn < viewer->drawn)
            return refuse(v, MALFORMED, "the page has drawn what it was not sent");
        viewer->drawn = drawn;
        plan(v);
        return 0;
    }
    if (message.which_message == 0)
        return 0; // of a later version
    if (!handler->on_page(handler->user, viewer->user, &message))
        return refuse(v, NOT_ALLOWED, "the page may not say so");
    ask_now(v);
    return 0;
}

int live_hear(struct visitor *v, const void *bytes, size_t size) {
    struct viewer *viewer = v->viewer;
    if (!viewer->user)
        return 0; // it is being closed
    if (!lws_frame_is_binary(v->socket))
        return refuse(v, NOT_BINARY, "messages are binary");
    if (size > sizeof viewer->incoming - viewer->used)
        return refuse(v, TOO_LONG, "messages are not longer than 4096 bytes");
    memcpy(viewer->incoming + viewer->used, bytes, size);
    viewer->used += size;
    if (lws_remaining_packet_payload(v->socket) || !lws_is_final_fragment(v->socket))
        return 0;
    int result = take_message(v);
    viewer->used = 0;
    return result;
}

// ---- what it is told ----------------------------------------------------------------------------

int live_write(struct visitor *v) {
    const struct web_handler *handler = &v->web->handler;
    struct viewer *viewer = v->viewer;
    if (viewer->closing) {
        lws_close_reason(v->socket, (enum lws_close_status)viewer->closing, NULL, 0);
        be_silent(v);
        return -1;
    }
    int64_t now_ns = clock_now_ns();
    if (!takes_more(viewer) || viewer->next_ns > now_ns)
        return 0;
    int64_t next_ns = now_ns;
    size_t size = handler->on_batch(handler->user, viewer->user, now_ns, v->web->bytes,
                                    WEB_BATCH_MAX, &next_ns);
    CHECK(size <= WEB_BATCH_MAX);
    viewer->next_ns = size == 0 && next_ns <= now_ns ? INT64_MAX : next_ns;
    if (size > 0) {
        viewer->sent++;
        if (lws_write(v->socket, v->web->bytes, size, LWS_WRITE_BINARY) < (int)size)
            return -1;
    }
    plan(v);
    return 0;
}
