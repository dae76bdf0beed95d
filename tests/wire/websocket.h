// A WebSocket client of the tests' own, on OpenSSL alone: it says what no good client would.
// Blocking, with 5 s of patience.
#pragma once

#include <stdbool.h>
#include <stddef.h>

enum {
    WEBSOCKET_MORE = 0,
    WEBSOCKET_TEXT = 1,
    WEBSOCKET_BINARY = 2,
    WEBSOCKET_CLOSE = 8,
    WEBSOCKET_PING = 9,
    WEBSOCKET_PONG = 10
};

struct websocket;

// To localhost over TLS 1.3. keys_dir: where station.pem and station.key are, NULL for no
// certificate. NULL where the server refuses the handshake.
struct websocket *websocket_open(int port, const char *keys_dir, const char *subprotocol);
// The same without TLS, to 127.0.0.1, asking in just these words. NULL where the answer is not 101;
// *out_status is the answer's, -1 where there was none.
struct websocket *websocket_ask(int port, const char *request, int *out_status);
// The same to localhost over TLS.
struct websocket *websocket_ask_safely(int port, const char *request, int *out_status);
int websocket_fd(const struct websocket *socket);

void websocket_close(struct websocket *socket);

// One WebSocket frame; `last`: the message ends with it.
bool websocket_send(struct websocket *socket, int opcode, bool last, const void *bytes,
                    size_t size);

// The next message, its size, with an answer to each ping before it; -1 once the server has closed,
// or says nothing for 5 s.
int websocket_receive(struct websocket *socket, void *out_bytes, size_t size);

// Reads on until the close frame: its status, -1 where the connection ends without one, or says
// nothing for 5 s.
int websocket_close_status(struct websocket *socket);

// Reads on until the other side ends the connection, by a close frame or at once; false where it
// says nothing for 5 s.
bool websocket_is_ended(struct websocket *socket);
