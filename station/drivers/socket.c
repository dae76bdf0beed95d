#include "drivers/socket.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum result socket_split(const char *address, char out_host[SOCKET_HOST_MAX],
                         char out_port[SOCKET_PORT_MAX], struct error *err) {
    const char *colon = strrchr(address, ':'), *host = address;
    size_t length = colon ? (size_t)(colon - address) : 0;
    if (length >= 2 && host[0] == '[' && host[length - 1] == ']') {
        host++;
        length -= 2;
    }
    if (!length || length >= SOCKET_HOST_MAX || !colon[1] || strlen(colon + 1) > 5 ||
        strspn(colon + 1, "0123456789") != strlen(colon + 1))
        return fail(err, RESULT_INVALID, "\"%.100s\" is not host:port", address);
    memcpy(out_host, host, length);
    out_host[length] = 0;
    strcpy(out_port, colon + 1);
    return RESULT_OK;
}

static enum result resolve(const char *address, int flags, struct addrinfo **out_info,
                           struct error *err) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = flags | AI_NUMERICSERV};
    enum result result = socket_split(address, host, port, err);
    if (result != RESULT_OK)
        return result;
    int code = getaddrinfo(host, port, &hints, out_info);
    return code ? fail(err, RESULT_MISSING, "%s: %s", address, gai_strerror(code)) : RESULT_OK;
}

static int open_socket(const struct addrinfo *info) {
    return socket(info->ai_family, info->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
}

static void set_option(int fd, int level, int option, int value) {
    setsockopt(fd, level, option, &value, sizeof value);
}

static void notice_vanished_peer(int fd) {
    set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
    set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, 1);
    set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, 1);
    set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, 3);
    set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
}

static enum result finish_connect(int fd, const char *address, int timeout_ms, struct error *err) {
    struct pollfd ready = {.fd = fd, .events = POLLOUT};
    if (poll(&ready, 1, timeout_ms) <= 0)
        return fail(err, RESULT_TIMEOUT, "%s: no connection within %d ms", address, timeout_ms);
    int code = 0;
    socklen_t size = sizeof code;
    getsockopt(fd, SOL_SOCKET, SO_ERROR, &code, &size);
    return code ? fail(err, RESULT_CLOSED, "%s: %s", address, strerror(code)) : RESULT_OK;
}

enum result socket_connect(const char *address, int timeout_ms, int *out_fd, struct error *err) {
    struct addrinfo *info;
    enum result result = resolve(address, 0, &info, err);
    if (result != RESULT_OK)
        return result;
    result = RESULT_CLOSED;
    for (struct addrinfo *at = info; at && result != RESULT_OK; at = at->ai_next) {
        int fd = open_socket(at);
        if (fd < 0 || (connect(fd, at->ai_addr, at->ai_addrlen) && errno != EINPROGRESS))
            result = fail(err, RESULT_CLOSED, "%s: %s", address, strerror(errno));
        else
            result = finish_connect(fd, address, timeout_ms, err);
        if (result == RESULT_OK)
            *out_fd = fd;
        else if (fd >= 0)
            close(fd);
    }
    freeaddrinfo(info);
    if (result == RESULT_OK)
        notice_vanished_peer(*out_fd);
    return result;
}

static uint16_t port_of(int fd) {
    struct sockaddr_storage name;
    socklen_t size = sizeof name;
    getsockname(fd, (struct sockaddr *)&name, &size);
    return ntohs(name.ss_family == AF_INET6 ? ((struct sockaddr_in6 *)&name)->sin6_port
                                            : ((struct sockaddr_in *)&name)->sin_port);
}

enum result socket_listen(const char *address, int *out_fd, uint16_t *out_port, struct error *err) {
    struct addrinfo *info;
    enum result result = resolve(address, AI_PASSIVE, &info, err);
    if (result != RESULT_OK)
        return result;
    int fd = open_socket(info);
    if (fd >= 0)
        set_option(fd, SOL_SOCKET, SO_REUSEADDR, 1);
    if (fd < 0 || bind(fd, info->ai_addr, info->ai_addrlen) || listen(fd, 8)) {
        result = fail(err, RESULT_IO, "%s: %s", address, strerror(errno));
        if (fd >= 0)
            close(fd);
    } else {
        *out_fd = fd;
        *out_port = port_of(fd);
    }
    freeaddrinfo(info);
    return result;
}
