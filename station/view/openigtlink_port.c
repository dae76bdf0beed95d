// What is at an outlet's port before anybody serves there.
#include "base/listen.h"
#include "igtl/names.h"
#include "view/openigtlink.h"

#include <netdb.h>
#include <openigtlink/igtl_header.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// The start of what whoever is there says to a client that comes. False: nothing.
static bool hear_first(const struct addrinfo *info, igtl_header *out) {
    struct timeval patience = {1, 0};
    int fd = socket(info->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return false;
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    bool heard = connect(fd, info->ai_addr, info->ai_addrlen) == 0 &&
                 recv(fd, out, sizeof *out, MSG_WAITALL) == (ssize_t)sizeof *out;
    close(fd);
    return heard;
}

// A station's first message is the session's state.
static bool is_outlet(const char *address, int port) {
    static const char type[IGTL_HEADER_TYPE_SIZE] = "STATUS";
    static const char device[IGTL_HEADER_NAME_SIZE] = IGTL_DEVICE;
    const struct addrinfo hints = {.ai_socktype = SOCK_STREAM,
                                   .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV};
    struct addrinfo *found = NULL;
    igtl_header header;
    char service[16];
    snprintf(service, sizeof service, "%d", port);
    bool is = getaddrinfo(address, service, &hints, &found) == 0 && hear_first(found, &header) &&
              !memcmp(header.name, type, sizeof type) &&
              !memcmp(header.device_name, device, sizeof device);
    if (found)
        freeaddrinfo(found);
    return is;
}

enum view_port_use openigtlink_look_at_port(const struct igtl_server_config *config,
                                            struct error *err) {
    const char *address = config->address[0] ? config->address : "127.0.0.1";
    if (listen_check(address, config->port, err) == RESULT_OK)
        return VIEW_PORT_FREE;
    bool ours = listen_check(address, 0, NULL) == RESULT_OK; // no other machine's
    return ours && is_outlet(address, config->port) ? VIEW_PORT_VIEW : VIEW_PORT_TAKEN;
}
