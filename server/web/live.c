#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "web/connection.h"

#include <stdlib.h>
#include <string.h>

#define RECHECK_US LWS_USEC_PER_SEC // is the token still that account's?
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

static int find_slot(const struct web *web, const struct web_connection *connection) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->sockets[i] == connection)
            return i;
    return -1;
}

bool live_is_full(const struct web *web) {
    return find_slot(web, NULL) < 0;
}

// From here on the handler does not know of it, and its place is free.
static void leave_live(struct web_connection *c) {
    int slot = find_slot(c->web, c);
    if (slot >= 0)
        c->web->sockets[slot] = NULL;
    lws_sul_cancel(&c->live->due);
    lws_sul_cancel(&c->live->recheck);
    if (c->live->user)
        c->web->handler.on_left(c->web->handler.user, c->live->user);
    c->live->user = NULL;
}

static void close_with(struct web_connection *c, enum close_status status) {
    if (c->live->closing)
        return;
    c->live->closing = (int)status;
    leave_live(c);
    lws_set_timer_usecs(c->socket, CLOSE_S * LWS_USEC_PER_SEC);
    lws_callback_on_writable(c->socket);
}

// Nothing more will be said to it.
static void stop_writing(struct web_connection *c) {
    c->web->open_sockets -= c->live->open;
    c->live->open = false;
}

static int close_now(struct web_connection *c) {
    if (!c->live->open)
        return 0;
    stop_writing(c);
    return ws_close(c->socket, c->live->closing);
}

void live_end(struct web_connection *c) {
    if (!c->live)
        return;
    stop_writing(c);
    leave_live(c);
    free(c->live);
    c->live = NULL;
}

// ---- when there is something to do
// ----------------------------------------------------------------

static void on_due(lws_sorted_usec_list_t *due) {
    struct live_socket *live = lws_container_of(due, struct live_socket, due);
    lws_callback_on_writable(live->connection->socket);
}

static bool takes_more(const struct live_socket *live) {
    return live->user && live->sent - live->drawn < WEB_BATCHES_ON_WAY;
}

static void plan(struct web_connection *c) {
    struct live_socket *live = c->live;
    int64_t now_ns = clock_now_ns();
    lws_sul_cancel(&live->due);
    if (!takes_more(live))
        return;
    if (live->next_ns <= now_ns)
        lws_callback_on_writable(c->socket);
    else if (live->next_ns < INT64_MAX)
        lws_sul_schedule(c->web->context, 0, &live->due, on_due,
                         (live->next_ns - now_ns + 999) / 1000);
}

static void poll_now(struct web_connection *c) {
    c->live->next_ns = 0;
    plan(c);
}

void live_wake(struct web *web) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->sockets[i])
            poll_now(web->sockets[i]);
}

void web_wake_viewer(struct web *web, const void *viewer) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->sockets[i] && web->sockets[i]->live->user == viewer)
            poll_now(web->sockets[i]);
}

void live_close_all(struct web *web) {
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        if (web->sockets[i])
            close_with(web->sockets[i], GOING_AWAY);
}

// ---- who it is ----------------------------------------------------------------------------------

static void look_up_account(struct web_connection *c) {
    c->task = web_task_create(WEB_TASK_ACCOUNT, c);
    memcpy(c->task->token, c->live->token, sizeof c->task->token);
    c->away = request_pool_add(c->web->pool, c->task);
    if (c->away)
        return;
    c->task->entry = RESULT_LIMIT;
    live_task_done(c, c->task);
}

static void on_recheck(lws_sorted_usec_list_t *recheck) {
    struct live_socket *live = lws_container_of(recheck, struct live_socket, recheck);
    look_up_account(live->connection);
}

int live_open(struct web_connection *c) {
    int slot = find_slot(c->web, NULL);
    CHECK(c->live && !c->task && slot >= 0); // checked before the upgrade
    c->web->sockets[slot] = c;
    c->web->open_sockets++;
    c->live->open = true;
    c->state = CONNECTION_LIVE;
    c->live->connection = c;
    c->live->next_ns = INT64_MAX;
    lws_rx_flow_control(c->socket, 0); // until it is known
    look_up_account(c);
    return 0;
}

static bool is_same(const struct web_account *a, const struct web_account *b) {
    return !strcmp(a->name, b->name) && !strcmp(a->role, b->role) &&
           !strcmp(a->trainee, b->trainee);
}

static void admit(struct web_connection *c) {
    const struct web_handler *handler = &c->web->handler;
    c->live->user = handler->on_viewer(handler->user, &c->live->account, c->live->token);
    if (!c->live->user) {
        close_with(c, TRY_LATER);
        return;
    }
    lws_rx_flow_control(c->socket, 1);
    poll_now(c);
}

// 0: it may stay.
static int check_live(const struct live_socket *live, const struct web_task *task) {
    bool is_in = live->user;
    if (task->entry == RESULT_OK)
        return is_in && !is_same(&task->account, &live->account) ? NOT_ALLOWED : 0;
    if (task->entry == RESULT_MISSING)
        return NOT_ALLOWED;
    return is_in ? 0 : TRY_LATER;
}

static void learn_of_live(struct web_connection *c, const struct web_task *task) {
    if (task->entry == RESULT_OK)
        places_prove(c, guests_enter(c->web->guests, task->token, &task->account, clock_now_ns()));
    else if (task->entry == RESULT_MISSING)
        guests_forget(c->web->guests, task->token);
}

void live_task_done(struct web_connection *c, struct web_task *task) {
    struct live_socket *live = c->live;
    c->task = NULL;
    int status = check_live(live, task);
    if (!live->user)
        live->account = task->account;
    learn_of_live(c, task);
    web_task_destroy(&task);
    if (live->closing)
        return;
    if (status) {
        close_with(c, (enum close_status)status);
        return;
    }
    lws_sul_schedule(c->web->context, 0, &live->recheck, on_recheck, RECHECK_US);
    if (!live->user)
        admit(c);
}

// ---- what the page says -------------------------------------------------------------------------

static int refuse_live(struct web_connection *c, enum close_status status, const char *text) {
    log_warning("web", "%s (%s): %s", c->address, c->live->account.name, text);
    c->live->closing = (int)status;
    leave_live(c);
    return close_now(c);
}

static int take_message(struct web_connection *c) {
    const struct web_handler *handler = &c->web->handler;
    struct live_socket *live = c->live;
    arthron_Page message;
    struct error err;
    if (!bucket_take(&live->messages, MESSAGES_S, MESSAGES_AT_ONCE, clock_now_ns()))
        return refuse_live(c, NOT_ALLOWED, "the page sends too many messages");
    if (wire_decode_page(live->incoming, live->used, &message, &err) != RESULT_OK)
        return refuse_live(c, MALFORMED, err.text);
    if (message.which_message == arthron_Page_drawn_tag) {
        uint64_t drawn = message.message.drawn.batches;
        if (drawn > live->sent || drawn < live->drawn)
            return refuse_live(c, MALFORMED, "the page acknowledged batches that it was not sent");
        live->drawn = drawn;
        plan(c);
        return 0;
    }
    if (message.which_message == 0)
        return 0; // of a later version
    if (!handler->on_page(handler->user, live->user, &message))
        return refuse_live(c, NOT_ALLOWED, "the page may not send this message");
    poll_now(c);
    return 0;
}

int live_receive(struct web_connection *c, const void *bytes, size_t size) {
    struct live_socket *live = c->live;
    if (!live->user)
        return 0; // it is being closed
    if (!lws_frame_is_binary(c->socket))
        return refuse_live(c, NOT_BINARY, "the message is not binary");
    if (size > sizeof live->incoming - live->used)
        return refuse_live(c, TOO_LONG, "the message is longer than 4096 bytes");
    memcpy(live->incoming + live->used, bytes, size);
    live->used += size;
    if (lws_remaining_packet_payload(c->socket) || !lws_is_final_fragment(c->socket))
        return 0;
    int result = take_message(c);
    live->used = 0;
    return result;
}

// ---- what it is told ----------------------------------------------------------------------------

int live_write(struct web_connection *c) {
    const struct web_handler *handler = &c->web->handler;
    struct live_socket *live = c->live;
    if (live->closing)
        return close_now(c);
    int64_t now_ns = clock_now_ns();
    if (!takes_more(live) || live->next_ns > now_ns)
        return 0;
    int64_t next_ns = now_ns;
    size_t size = handler->on_batch(handler->user, live->user, now_ns, c->web->bytes, WEB_BATCH_MAX,
                                    &next_ns);
    CHECK(size <= WEB_BATCH_MAX);
    live->next_ns = size == 0 && next_ns <= now_ns ? INT64_MAX : next_ns;
    if (size > 0) {
        live->sent++;
        if (lws_write(c->socket, c->web->bytes, size, LWS_WRITE_BINARY) < (int)size)
            return -1;
    }
    plan(c);
    return 0;
}
