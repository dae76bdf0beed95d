// Commands over the server's local socket (a WebSocket on a UNIX socket, subprotocol
// arthron-console.1), the same messages that the instructor's console will send.
#pragma once

#include "wire/wire.h"

struct console;

struct console_handler {
    void *user;
    // Out of the console's own thread, which all callers share; of an UNDO or COPY out of a thread
    // of its own, beside the others. actor: the system's user who asks.
    void (*on_command)(void *user, const char *actor, const arthron_Command *command,
                       arthron_CommandReply *out_reply);
    // False where there is no such station.
    bool (*on_metrics)(void *user, const char *station, arthron_Metrics *out_metrics);
};

// Makes the socket (mode 0600) and starts the thread. A stale socket file is replaced; one that
// answers is RESULT_REFUSED: another server is running.
enum result console_create(const char *socket_path, const struct console_handler *handler,
                           struct console **out_console, struct error *err);
void console_destroy(struct console **console); // waits for the commands that are being done

// The other end: one command to a running server. RESULT_MISSING: no server at that path.
enum result console_call(const char *socket_path, const arthron_Command *command,
                         arthron_CommandReply *out_reply, struct error *err);

// What a station's session is worth so far. RESULT_REFUSED where the server has no such station.
enum result console_ask_metrics(const char *socket_path, const char *station,
                                arthron_Metrics *out_metrics, struct error *err);
