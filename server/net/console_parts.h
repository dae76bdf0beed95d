// The common part of both ends of the local socket.
#pragma once

#include "wire/wire.h"

#include <libwebsockets.h>
#include <stdbool.h>

// One message in each direction, and libwebsockets' room before what goes out.
struct exchange {
    size_t in_size, out_size;
    bool waits; // for a long command
    uint8_t in[WIRE_CONSOLE_MAX];
    uint8_t header[LWS_PRE];
    uint8_t out[WIRE_CONSOLE_MAX];
};

// False: too long. *out_whole: all of the message is there.
bool console_collect(struct exchange *exchange, struct lws *socket, const void *bytes, size_t size,
                     bool *out_whole);

// Returns -1, for libwebsockets, to close the connection.
int console_write(struct exchange *exchange, struct lws *socket);

enum result console_check_length(const char *path, struct error *err);

// The error names the owner of the socket.
enum result console_refuse_user(const char *path, struct error *err);

// Whether the command may run cuts or a whole session again.
bool console_is_long(arthron_Command_Kind kind);
