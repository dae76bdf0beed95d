#include "wire/browser.h"

#include <arpa/inet.h>
#include <errno.h>
#include <openssl/ssl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct browser {
    int fd;
    SSL_CTX *context;
    SSL *tls;
};

struct browser *browser_open(int port) {
    return browser_open_with(port, 0);
}

struct browser *browser_open_with(int port, int tls_version) {
    struct browser *b = calloc(1, sizeof *b);
    struct timeval patience = {10, 0};
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    b->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(b->fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    b->context = SSL_CTX_new(TLS_client_method());
    SSL_CTX_set_security_level(b->context, 0); // else it would not even try an old one
    SSL_CTX_set_min_proto_version(b->context, tls_version);
    SSL_CTX_set_max_proto_version(b->context, tls_version);
    b->tls = SSL_new(b->context);
    SSL_set_fd(b->tls, b->fd);
    if (connect(b->fd, (struct sockaddr *)&address, sizeof address) == 0 &&
        SSL_connect(b->tls) == 1)
        return b;
    browser_close(b);
    return NULL;
}

void browser_close(struct browser *b) {
    SSL_free(b->tls);
    SSL_CTX_free(b->context);
    close(b->fd);
    free(b);
}

int browser_fd(const struct browser *b) {
    return b->fd;
}

void browser_certificate(const struct browser *b, char out[65]) {
    X509 *certificate = SSL_get1_peer_certificate(b->tls);
    unsigned char digest[32];
    unsigned size;
    X509_digest(certificate, EVP_sha256(), digest, &size);
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", digest[i]);
    X509_free(certificate);
}

bool browser_say(struct browser *b, const void *bytes, size_t size) {
    return size == 0 || SSL_write(b->tls, bytes, (int)size) == (int)size;
}

static bool read_all(struct browser *b, char *out, size_t size) {
    for (size_t used = 0; used < size;) {
        int n = SSL_read(b->tls, out + used, (int)(size - used));
        if (n <= 0)
            return false;
        used += (size_t)n;
    }
    return true;
}

static bool read_head(struct browser *b, char *out, size_t size) {
    for (size_t used = 0; used < size - 1;) {
        if (!read_all(b, out + used, 1))
            return false;
        out[++used] = '\0';
        if (used >= 4 && !strcmp(out + used - 4, "\r\n\r\n"))
            return true;
    }
    return false;
}

const char *answered_header(const struct answered *answered, const char *name, char out[512]) {
    size_t length = strlen(name);
    out[0] = '\0';
    for (const char *line = strstr(answered->head, "\r\n"); line; line = strstr(line, "\r\n")) {
        line += 2;
        if (!strncasecmp(line, name, length) && line[length] == ':') {
            const char *value = line + length + 1 + strspn(line + length + 1, " ");
            snprintf(out, 512, "%.*s", (int)strcspn(value, "\r"), value);
            return out;
        }
    }
    return out;
}

struct answered browser_hear(struct browser *b, bool bodiless) {
    struct answered a = {.status = -1};
    char length[512];
    if (!read_head(b, a.head, sizeof a.head) || strncmp(a.head, "HTTP/1.1 ", 9))
        return a;
    int status = atoi(a.head + 9);
    answered_header(&a, "Content-Length", length);
    a.size = bodiless ? 0 : (size_t)atoll(length);
    a.body = calloc(1, a.size + 1);
    if (read_all(b, a.body, a.size)) {
        a.status = status;
    } else {
        free(a.body);
        a.body = NULL;
    }
    return a;
}

struct answered browser_ask(struct browser *b, const char *line, const char *headers) {
    char text[4096];
    int size =
        snprintf(text, sizeof text, "%s HTTP/1.1\r\nHost: localhost:1\r\n%s\r\n", line, headers);
    if (!browser_say(b, text, (size_t)size))
        return (struct answered){.status = -1};
    return browser_hear(b, !strncmp(line, "HEAD", 4));
}

bool browser_is_ended(struct browser *b) {
    char bytes[4096];
    errno = 0;
    while (SSL_read(b->tls, bytes, sizeof bytes) > 0)
        errno = 0;
    return errno != EAGAIN;
}
