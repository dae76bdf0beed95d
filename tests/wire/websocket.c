#include "wire/websocket.h"

#include <arpa/inet.h>
#include <errno.h>
#include <openssl/ssl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct websocket {
    int fd;
    SSL_CTX *context;
    SSL *tls; // NULL: without TLS
};

void websocket_close(struct websocket *s) {
    SSL_free(s->tls);
    SSL_CTX_free(s->context);
    close(s->fd);
    free(s);
}

static bool read_all(struct websocket *s, void *bytes, size_t size) {
    for (size_t used = 0; used < size;) {
        char *at = (char *)bytes + used;
        int n = s->tls ? SSL_read(s->tls, at, (int)(size - used))
                       : (int)recv(s->fd, at, size - used, 0);
        if (n <= 0)
            return false;
        used += (size_t)n;
    }
    return true;
}

static bool write_all(struct websocket *s, const void *bytes, size_t size) {
    int n =
        s->tls ? SSL_write(s->tls, bytes, (int)size) : (int)send(s->fd, bytes, size, MSG_NOSIGNAL);
    return n == (int)size;
}

static bool connect_to(struct websocket *s, int port) {
    struct timeval patience = {5, 0};
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    s->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(s->fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return connect(s->fd, (struct sockaddr *)&address, sizeof address) == 0;
}

static bool secure(struct websocket *s, const char *keys_dir) {
    char path[512];
    s->context = SSL_CTX_new(TLS_client_method());
    if (keys_dir) {
        snprintf(path, sizeof path, "%s/station.pem", keys_dir);
        SSL_CTX_use_certificate_chain_file(s->context, path);
        snprintf(path, sizeof path, "%s/station.key", keys_dir);
        SSL_CTX_use_PrivateKey_file(s->context, path, SSL_FILETYPE_PEM);
    }
    s->tls = SSL_new(s->context);
    SSL_set_fd(s->tls, s->fd);
    return SSL_connect(s->tls) == 1;
}

// The status of the answer; -1: none.
static int upgrade(struct websocket *s, const char *request) {
    char text[2048];
    size_t used = 0;
    if (!write_all(s, request, strlen(request)))
        return -1;
    while (used < sizeof text - 1 && read_all(s, text + used, 1)) {
        text[++used] = '\0';
        if (strstr(text, "\r\n\r\n"))
            return strncmp(text, "HTTP/1.", 7) ? -1 : atoi(text + 9);
    }
    return -1;
}

struct websocket *websocket_open(int port, const char *keys_dir, const char *subprotocol) {
    char request[512];
    snprintf(request, sizeof request,
             "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n"
             "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
             "Sec-WebSocket-Protocol: %s\r\n\r\n",
             subprotocol);
    struct websocket *s = calloc(1, sizeof *s);
    if (connect_to(s, port) && secure(s, keys_dir) && upgrade(s, request) == 101)
        return s;
    websocket_close(s);
    return NULL;
}

struct websocket *websocket_ask(int port, const char *request, int *out_status) {
    struct websocket *s = calloc(1, sizeof *s);
    *out_status = connect_to(s, port) ? upgrade(s, request) : -1;
    if (*out_status == 101)
        return s;
    websocket_close(s);
    return NULL;
}

struct websocket *websocket_ask_safely(int port, const char *request, int *out_status) {
    struct websocket *s = calloc(1, sizeof *s);
    *out_status = connect_to(s, port) && secure(s, NULL) ? upgrade(s, request) : -1;
    if (*out_status == 101)
        return s;
    websocket_close(s);
    return NULL;
}

int websocket_fd(const struct websocket *s) {
    return s->fd;
}

bool websocket_send(struct websocket *s, int opcode, bool last, const void *bytes, size_t size) {
    static const uint8_t mask[4] = {0x12, 0x34, 0x56, 0x78};
    uint8_t *frame = malloc(size + 8);
    size_t used = 0;
    frame[used++] = (uint8_t)(opcode | (last ? 0x80 : 0));
    if (size < 126) {
        frame[used++] = (uint8_t)(0x80 | size);
    } else {
        frame[used++] = 0x80 | 126;
        frame[used++] = (uint8_t)(size >> 8);
        frame[used++] = (uint8_t)size;
    }
    memcpy(frame + used, mask, 4);
    used += 4;
    for (size_t i = 0; i < size; i++)
        frame[used++] = ((const uint8_t *)bytes)[i] ^ mask[i % 4];
    bool sent = write_all(s, frame, used);
    free(frame);
    return sent;
}

// Opcode and length of the next frame; -1: there is none, or it is too long for us.
static int read_head(struct websocket *s, size_t *out_payload) {
    uint8_t head[2], length[2];
    if (!read_all(s, head, 2))
        return -1;
    *out_payload = head[1] & 0x7f;
    if (*out_payload == 127 || (*out_payload == 126 && !read_all(s, length, 2)))
        return -1;
    if (*out_payload == 126)
        *out_payload = (size_t)length[0] << 8 | length[1];
    return head[0] & 0x0f;
}

static bool answer_ping(struct websocket *s, size_t payload) {
    uint8_t bytes[125];
    return payload <= sizeof bytes && read_all(s, bytes, payload) &&
           websocket_send(s, WEBSOCKET_PONG, true, bytes, payload);
}

int websocket_receive(struct websocket *s, void *out_bytes, size_t size) {
    size_t payload;
    int opcode;
    while ((opcode = read_head(s, &payload)) == WEBSOCKET_PING)
        if (!answer_ping(s, payload))
            return -1;
    if (opcode != WEBSOCKET_BINARY || payload > size || !read_all(s, out_bytes, payload))
        return -1;
    return (int)payload;
}

int websocket_close_status(struct websocket *s) {
    uint8_t bytes[65536];
    size_t payload;
    for (int opcode; (opcode = read_head(s, &payload)) >= 0;) {
        if (opcode == WEBSOCKET_PING ? !answer_ping(s, payload) : !read_all(s, bytes, payload))
            return -1;
        if (opcode == WEBSOCKET_CLOSE)
            return payload < 2 ? 1005 : bytes[0] << 8 | bytes[1];
    }
    return -1;
}

bool websocket_is_ended(struct websocket *s) {
    uint8_t bytes[65536];
    size_t payload;
    errno = 0;
    for (int opcode; (opcode = read_head(s, &payload)) >= 0;)
        if (opcode == WEBSOCKET_CLOSE || !read_all(s, bytes, payload))
            break;
    return errno != EAGAIN;
}
