#include "base/listen.h"

#include <errno.h>
#include <netdb.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static int try_bind(const struct addrinfo *info) {
    int fd = socket(info->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return 0;
    const int on = 1; // as servers do: connections that end do not count
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (info->ai_family == AF_INET6)
        setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &on, sizeof on);
    int reason = bind(fd, info->ai_addr, info->ai_addrlen) || listen(fd, 1) ? errno : 0;
    close(fd);
    return reason;
}

enum result listen_check(const char *address, int port, struct error *err) {
    char service[16];
    const struct addrinfo hints = {.ai_socktype = SOCK_STREAM,
                                   .ai_flags = AI_PASSIVE | AI_NUMERICSERV};
    struct addrinfo *found = NULL;
    snprintf(service, sizeof service, "%d", port);
    if (getaddrinfo(address, service, &hints, &found))
        return RESULT_OK;
    int reason = 0;
    for (const struct addrinfo *info = found; info && !reason; info = info->ai_next)
        reason = try_bind(info);
    freeaddrinfo(found);
    return reason ? listen_failed("TCP", address, port, reason, err) : RESULT_OK;
}

enum result listen_failed(const char *protocol, const char *address, int port, int reason,
                          struct error *err) {
    if (reason == EADDRINUSE)
        return fail(err, RESULT_IO, "%s port %d is in use%s%s", protocol, port,
                    address ? " at " : "", address ? address : "");
    if (reason == EADDRNOTAVAIL)
        return fail(err, RESULT_IO, "%s port %d: this machine has no address %s", protocol, port,
                    address ? address : "");
    if (reason == EACCES && port < 1024)
        return fail(err, RESULT_IO, "%s port %d: only root may listen below port 1024", protocol,
                    port);
    return fail(err, RESULT_IO, "%s port %d: %s", protocol, port, strerror(reason));
}
