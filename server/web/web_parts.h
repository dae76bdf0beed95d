// The inside of the web room: what web.c (the thread, the connections), visit.c (HTTP) and live.c
// (WebSockets) share. Everything belongs to the web thread except what is marked.
#pragma once

#include "web/answer.h"
#include "web/clerks.h"
#include "web/door.h"
#include "web/guests.h"
#include "web/renewal.h"
#include "web/web.h"

#include <libwebsockets.h>
#include <pthread.h>
#include <stdatomic.h>

#define WEB_PIECE 32768 // of an answer, written at once

struct visitor;

// An HTTP status and why; status 0: none.
struct refusal {
    int status;
    const char *code, *text;
    bool closes; // the connection: what else comes on it is not to be understood
};

// A page that looks on.
struct viewer {
    struct visitor *visitor;
    void *user; // the handler's; NULL: it does not know of it yet, or no more
    char token[DOOR_TOKEN_MAX];
    struct web_account account;
    uint64_t sent, drawn; // batches
    int64_t next_ns;      // when to ask for the next one; INT64_MAX: not by itself
    int closing;          // the close frame's status; 0: not closing
    bool open;            // something may be said to it, the close frame at last
    struct bucket messages;
    lws_sorted_usec_list_t due, renewal;
    size_t used; // of incoming
    uint8_t incoming[WIRE_PAGE_MAX];
};

// A connection.
struct visitor {
    struct web *web;
    struct lws *socket;
    struct guest *guest;
    char address[48];
    enum {
        VISIT_IDLE,    // between requests
        VISIT_READING, // a request's body
        VISIT_WAITING, // for the clerks
        VISIT_SENDING, // the answer
        VISIT_LIVE     // a WebSocket
    } state;
    struct job *job; // READING: being filled; with the clerks where `away`
    bool away;
    lws_sorted_usec_list_t body_due;
    bool heard;             // the end of the body
    struct refusal refusal; // READING: behind the body
    struct answer answer;   // SENDING
    bool head_sent;
    size_t sent; // of the answer's bytes
    struct viewer *viewer;
};

struct web {
    struct web_handler handler;
    struct web_pages pages;
    int patience_s, renewal_s;
    lws_retry_bo_t liveness; // of WebSockets
    struct door *door;
    struct renewal *renewal;
    lws_sorted_usec_list_t renewal_due;
    struct guests *guests;
    struct clerks *clerks;
    struct lws_context *context;
    SSL_CTX *no_client; // else libwebsockets makes one with all of the system's authorities
    int port;
    pthread_t thread;
    struct bucket turns;
    atomic_bool stopping; // any thread
    atomic_bool woken;    // any thread
    bool draining, drained;
    lws_sorted_usec_list_t drain;
    struct visitor *live[WEB_VIEWERS_MAX]; // NULL: free
    int live_sockets;                      // that are open
    uint8_t header[LWS_PRE];               // libwebsockets writes its own before the bytes
    uint8_t bytes[WEB_BATCH_MAX];
};

_Static_assert(WEB_PIECE + ANSWER_HEAD_MAX <= WEB_BATCH_MAX,
               "a head and a piece are written at once");

// ---- visit.c: HTTP; an int is what libwebsockets wants: -1 closes the connection ----------------

int visit_begin(struct visitor *visitor); // a request's headers are there
int visit_hear(struct visitor *visitor, const void *bytes, size_t size); // of its body
int visit_heard(struct visitor *visitor);                                // all of it
int visit_write(struct visitor *visitor);
void visit_answered(struct visitor *visitor, struct job *job); // takes the job
void visit_end(struct visitor *visitor);                       // of the connection

// Whether the request may become a WebSocket: 0; else it was answered.
int visit_upgrade(struct visitor *visitor, const char *protocol);

// ---- live.c -------------------------------------------------------------------------------------

int live_open(struct visitor *visitor);
int live_hear(struct visitor *visitor, const void *bytes, size_t size);
int live_write(struct visitor *visitor);
void live_answered(struct visitor *visitor, struct job *job); // takes the job
void live_end(struct visitor *visitor);                       // of the connection

bool live_is_full(const struct web *web);
void live_wake(struct web *web);
void live_drain(struct web *web); // tells all that the server stops
