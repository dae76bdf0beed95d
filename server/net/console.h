// Commands over the server's local socket (a WebSocket on a UNIX socket, subprotocol
// arthron-console.1), the same messages that the instructor's console will send.
#pragma once

#include "wire/wire.h"

struct console;

struct console_handler {
    void *user;
    // On the console's thread, which all callers share. UNDO and COPY run on threads of their own.
    // actor: the user of the system who sent the command.
    void (*on_command)(void *user, const char *actor, const arthron_Command *command,
                       arthron_CommandReply *out_reply);
    // False: there is no such station.
    bool (*on_metrics)(void *user, const char *station, arthron_Metrics *out_metrics);
};

// Makes the socket (mode 0600) and starts the thread. A stale socket file is replaced; one that
// answers is RESULT_REFUSED: another server is running.
enum result console_create(const char *socket_path, const struct console_handler *handler,
                           struct console **out_console, struct error *err);
void console_destroy(struct console **console); // waits for the commands that run

// The other end: one command to a running server. RESULT_MISSING: no server at that path.
enum result console_call(const char *socket_path, const arthron_Command *command,
                         arthron_CommandReply *out_reply, struct error *err);

// The metrics of a station's session so far. RESULT_REFUSED: the server has no such station.
enum result console_ask_metrics(const char *socket_path, const char *station,
                                arthron_Metrics *out_metrics, struct error *err);
