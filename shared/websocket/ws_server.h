// What all servers of WebSockets share: a socket that listens, a thread that serves it, words from
// other threads, and an end that leaves time for a goodbye. What is said is the owner's, in
// libwebsockets' callbacks; lws_context_user is the handler's `user`.
#pragma once

#include "base/result.h"

#include <libwebsockets.h>
#include <stdbool.h>

struct ws_server;

enum ws_server_kind {
    WS_SERVER_TLS,   // TCP, with the certificate and the key of `info`
    WS_SERVER_PLAIN, // TCP over IPv4
    WS_SERVER_LOCAL  // a Unix socket, at the path info.iface
};

// Out of the server's thread; none may block. Each may be NULL.
struct ws_server_handler {
    void *user;
    void (*on_wake)(void *user);    // behind ws_server_wake; several calls may be one
    void (*on_stop)(void *user);    // once: say goodbye to who is there
    bool (*is_empty)(void *user);   // after on_stop: nobody is left. NULL: there is no goodbye
    void (*after_turn)(void *user); // of the thread's loop
};

// Listens. `info` has what is special to the owner: iface and port, vhost_name, protocols, files,
// limits and timeouts; the rest is filled in here. RESULT_IO tells why it cannot listen.
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

// Calls on_stop, gives goodbyes half a second, joins the thread. It can still be woken.
void ws_server_stop(struct ws_server *server);

void ws_server_destroy(struct ws_server **server); // NULL inside is fine; stopped, or not started

// Little may wait in the kernel, so that new messages do not queue behind old ones.
void ws_keep_queue_short(struct lws *socket);
