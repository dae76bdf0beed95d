// What is at a view's port before anybody serves there.
#include "base/check.h"
#include "view/view.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static struct sockaddr_in address_of(int port) {
    return (struct sockaddr_in){.sin_family = AF_INET,
                                .sin_port = htons((uint16_t)port),
                                .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
}

static int open_socket(void) {
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    NEED(fd >= 0, "descriptor");
    return fd;
}

static bool is_free(int port) {
    struct sockaddr_in address = address_of(port);
    int one = 1, fd = open_socket();
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    bool bound = bind(fd, (const struct sockaddr *)&address, sizeof address) == 0;
    close(fd);
    return bound;
}

// The status of the answer to a viewer without a token; 0: it is no HTTP, or there is none.
static int ask(int port) {
    static const char request[] = "GET /view HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n"
                                  "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                                  "Sec-WebSocket-Key: YXJ0aHJvbi1zdGF0aW9uIQ==\r\n"
                                  "Sec-WebSocket-Protocol: " WIRE_VIEW_SUBPROTOCOL "\r\n\r\n";
    static const ssize_t size = sizeof request - 1;
    struct sockaddr_in address = address_of(port);
    struct timeval patience = {1, 0};
    char answer[16] = "";
    int fd = open_socket(), status = 0;
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (connect(fd, (const struct sockaddr *)&address, sizeof address) == 0 &&
        send(fd, request, (size_t)size, MSG_NOSIGNAL) == size &&
        recv(fd, answer, sizeof answer - 1, MSG_WAITALL) > 0)
        sscanf(answer, "HTTP/1.%*1d %3d", &status);
    close(fd);
    return status;
}

enum view_port_use view_look_at_port(int port) {
    if (is_free(port))
        return VIEW_PORT_FREE;
    return ask(port) == 403 ? VIEW_PORT_VIEW : VIEW_PORT_TAKEN;
}
