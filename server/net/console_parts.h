// What the two ends of the local socket share.
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

// What libwebsockets wants: -1 closes the connection.
int console_write(struct exchange *exchange, struct lws *socket);

enum result console_check_length(const char *path, struct error *err);

// Says whose socket it is.
enum result console_refuse_user(const char *path, struct error *err);

// Of what runs a session's cuts or all of it again.
bool console_is_long(arthron_Command_Kind kind);
