// The common part of all servers on libwebsockets: a socket that listens, a thread that serves it,
// a way for other threads to wake it, and an end with time for last messages. The owner sends and
// receives in libwebsockets' callbacks; lws_context_user is the handler's `user`.
#pragma once

#include "base/result.h"

#include <libwebsockets.h>
#include <stdbool.h>

struct ws_server;

enum ws_server_kind {
    WS_SERVER_TLS,   // TCP, with the certificate and the key of `info`
    WS_SERVER_PLAIN, // TCP over IPv4
    WS_SERVER_LOCAL, // a Unix socket, at the path info.iface
    WS_SERVER_RAW    // TCP without HTTP: connections are LWS_CALLBACK_RAW_ of the first protocol
};

// The server's thread calls these; none may block. Each may be NULL.
struct ws_server_handler {
    void *user;
    void (*on_wake)(void *user);    // after ws_server_wake; one call for several wakes
    void (*on_stop)(void *user);    // once: send last messages to the peers
    bool (*is_empty)(void *user);   // after on_stop: all peers have left. NULL: do not wait
    void (*after_turn)(void *user); // after each turn of the thread's loop
};

// Connections that a server may have where it wants so many and some descriptors besides: fewer
// where the system gives few, so that no server takes those of another one, nor of files.
int ws_server_places(int wanted, int spare, int *out_spare);

// Listens. The owner sets iface and port, vhost_name, protocols, files, limits and timeouts in
// `info`; the rest is filled in here. RESULT_IO says why it cannot listen.
enum result ws_server_create(enum ws_server_kind kind, const struct lws_context_creation_info *info,
                             const struct ws_server_handler *handler, struct ws_server **out_server,
                             struct error *err);

int ws_server_port(const struct ws_server *server);
struct lws_context *ws_server_context(const struct ws_server *server);

void ws_server_start(struct ws_server *server); // the thread

// From any thread until ws_server_destroy, never waits.
void ws_server_wake(struct ws_server *server);

// The server's thread: whether on_stop was called, or is about to be.
bool ws_server_stops(const struct ws_server *server);

// Calls on_stop, gives last messages half a second, joins the thread. ws_server_wake is still safe.
void ws_server_stop(struct ws_server *server);

void ws_server_destroy(struct ws_server **server); // NULL inside is fine; stopped, or not started

// Closes a WebSocket in order: it says the status (RFC 6455, section 7.4) and ends with the other
// side's close frame, or with LWS_CALLBACK_TIMER after a second, which then returns ws_end. Its
// callback receives until then. Not lws_close_reason: with that, libwebsockets never returns from
// reading while a sender over TLS has more. -1: end it now.
int ws_close(struct lws *socket, int status);

// What a callback returns to LWS_CALLBACK_WS_PEER_INITIATED_CLOSE, for the same reason. closes:
// after ws_close.
int ws_closed(struct lws *socket, bool closes);

// What a callback returns to end a WebSocket now. Nothing more is read from it: libwebsockets never
// returns from reading what an ended socket sends while something written waits.
int ws_end(struct lws *socket);

// Keeps the kernel's send buffer short, so that new messages do not queue behind old ones.
void ws_keep_queue_short(struct lws *socket);
