// Shared by server.c (the thread, the connections), http.c and live.c (WebSockets). Everything
// belongs to the web thread, unless it is marked.
#pragma once

#include "web/answer.h"
#include "web/guests.h"
#include "web/host_check.h"
#include "web/rate_limits.h"
#include "web/request_pool.h"
#include "web/web.h"
#include "websocket/tls_files.h"
#include "websocket/ws_server.h"

#include <libwebsockets.h>
#include <pthread.h>
#include <stdatomic.h>

#define WEB_PIECE 32768         // of an answer, written at once
#define WEB_DOWNLOADS_MAX 64    // at a time
#define WEB_DOWNLOADS_OWN 4     // of one owner
#define WEB_CONNECTIONS_SPARE 8 // the listening socket, the one that wakes, those that leave
#define WEB_CONNECTIONS_ALL (WEB_CONNECTIONS_MAX + WEB_CONNECTIONS_SPARE)

struct web_connection;

// An HTTP status and why; status 0: none.
struct refusal {
    int status;
    const char *code, *text;
    bool closes; // the connection, because what follows on it cannot be parsed
};

// A WebSocket of a page.
struct live_socket {
    struct web_connection *connection;
    void *user; // the handler's; NULL: before on_viewer, and after on_left
    char token[WEB_TOKEN_MAX];
    struct web_account account;
    uint64_t sent, drawn; // batches
    int64_t next_ns;      // when to ask for the next one; INT64_MAX: not by itself
    int closing;          // the close frame's status; 0: not closing
    bool open;            // frames may still be sent, the close frame last
    struct bucket messages;
    lws_sorted_usec_list_t due, recheck;
    size_t used; // of incoming
    uint8_t incoming[WIRE_PAGE_MAX];
};

struct web_connection {
    struct web *web;
    struct lws *socket;
    struct rate_limit *limit;
    struct guest *guest; // NULL: a stranger
    int slot;            // of web->connections
    int64_t since_ns;
    bool leaves; // it made room for another one
    char address[48];
    enum {
        CONNECTION_IDLE,    // between requests
        CONNECTION_READING, // a request's body
        CONNECTION_WAITING, // for the pool
        CONNECTION_SENDING, // the answer
        CONNECTION_LIVE     // a WebSocket
    } state;
    struct web_task *task; // READING: being filled; with the pool where `away`
    bool away;
    lws_sorted_usec_list_t body_due;
    bool body_ended;
    struct refusal refusal; // READING: behind the body
    struct answer answer;   // SENDING
    bool head_sent;
    size_t sent; // of the answer's bytes
    struct live_socket *live;
    char downloader[64]; // whose file is the answer; empty: nobody's
};

struct web {
    struct web_handler handler;
    struct web_pages pages;
    int timeout_s;
    lws_retry_bo_t liveness; // of WebSockets
    struct host_check *hosts;
    struct tls_files *tls_files;
    SSL_CTX *tls; // of the connections to come; libwebsockets'
    lws_sorted_usec_list_t renewal_due;
    struct rate_limits *limits;
    struct guests *guests;
    int places, spare; // connections that may stay; more that may be leaving
    int outgoing;      // the handler's own
    atomic_int here;   // connections
    int staying;       // those of them that do not leave
    struct web_connection *connections[WEB_CONNECTIONS_ALL]; // NULL: free
    struct request_pool *pool;
    struct ws_server *server;
    struct lws_context *context; // the server's
    struct bucket turns;
    atomic_bool woken;                               // any thread
    struct web_connection *sockets[WEB_VIEWERS_MAX]; // NULL: free
    atomic_int open_sockets;
    atomic_uint_fast64_t answers[6]; // as of web_counts
    atomic_int_fast64_t certificate_until_s;
    struct web_connection *downloads[WEB_DOWNLOADS_MAX]; // NULL: free
    uint8_t header[LWS_PRE]; // libwebsockets writes its own before the bytes
    uint8_t bytes[WEB_BATCH_MAX];
};

_Static_assert(WEB_PIECE + ANSWER_HEAD_MAX <= WEB_BATCH_MAX,
               "a head and a piece are written at once");

// ---- http.c; an int is what libwebsockets wants: -1 closes the connection ----------------

int http_begin(struct web_connection *connection); // a request's headers are there
int http_take_body(struct web_connection *connection, const void *bytes,
                   size_t size);                      // of its body
int http_end_body(struct web_connection *connection); // all of it
int http_write(struct web_connection *connection);
void http_task_done(struct web_connection *connection, struct web_task *task); // takes the task
void http_end(struct web_connection *connection);                              // of the connection

// Whether the request may become a WebSocket: 0; else it was answered.
int http_upgrade(struct web_connection *connection, const char *protocol);

// ---- places.c -----------------------------------------------------------------------------------

// Whether a new connection of this address may come in; another one may have to leave for it.
bool places_let_in(struct web *web, struct rate_limit *limit);
bool places_open(struct web_connection *connection); // false: there is no room
void places_close(struct web_connection *connection);

// It has shown a token of this account.
void places_prove(struct web_connection *connection, struct guest *guest);

// ---- live.c -------------------------------------------------------------------------------------

int live_open(struct web_connection *connection);
int live_receive(struct web_connection *connection, const void *bytes, size_t size);
int live_write(struct web_connection *connection);
void live_task_done(struct web_connection *connection, struct web_task *task); // takes the task
void live_end(struct web_connection *connection);                              // of the connection

bool live_is_full(const struct web *web);
void live_wake(struct web *web);
void live_close_all(struct web *web); // tells all that the server stops
