#include "base/source.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>

static bool is_near(int fd, const struct in6_addr *address) {
    struct sockaddr_in6 here = {0};
    socklen_t size = sizeof here;
    if (IN6_IS_ADDR_LINKLOCAL(address))
        return true;
    return !getsockname(fd, (struct sockaddr *)&here, &size) && here.sin6_family == AF_INET6 &&
           !memcmp(&here.sin6_addr, address, 8);
}

bool source_of(int fd, struct source *out) {
    struct sockaddr_storage address = {0};
    socklen_t size = sizeof address;
    uint8_t *bytes = out->address.s6_addr;
    if (getpeername(fd, (struct sockaddr *)&address, &size))
        return false;
    memset(out, 0, sizeof *out);
    if (address.ss_family == AF_INET) {
        memset(bytes + 10, 0xff, 2);
        memcpy(bytes + 12, &((const struct sockaddr_in *)&address)->sin_addr, 4);
    } else if (address.ss_family == AF_INET6) {
        out->address = ((const struct sockaddr_in6 *)&address)->sin6_addr;
        bool is_ipv4 = IN6_IS_ADDR_V4MAPPED(&out->address);
        out->near = !is_ipv4 && is_near(fd, &out->address);
        if (!is_ipv4 && !out->near)
            memset(bytes + 8, 0, 8);
    }
    return true;
}

bool source_is(const struct source *a, const struct source *b) {
    return !memcmp(&a->address, &b->address, sizeof a->address);
}

void source_write(const struct source *source, char out[SOURCE_TEXT_SIZE]) {
    const struct in6_addr *address = &source->address;
    if (IN6_IS_ADDR_V4MAPPED(address)) {
        inet_ntop(AF_INET, address->s6_addr + 12, out, SOURCE_TEXT_SIZE);
        return;
    }
    inet_ntop(AF_INET6, address, out, SOURCE_TEXT_SIZE);
    if (!source->near)
        snprintf(out + strlen(out), SOURCE_TEXT_SIZE - strlen(out), "/64");
}
