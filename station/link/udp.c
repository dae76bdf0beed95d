#include "link/udp.h"

#include <errno.h>
#include <netinet/in.h>
#include <string.h>
#include <unistd.h>

static void forget(struct udp_epoch *epoch) {
    seal_destroy(&epoch->to_server);
    seal_destroy(&epoch->to_station);
    *epoch = (struct udp_epoch){0};
}

void udp_init(struct udp *udp) {
    *udp = (struct udp){.fd = -1};
}

void udp_close(struct udp *udp) {
    if (udp->fd >= 0)
        close(udp->fd);
    forget(&udp->present);
    forget(&udp->before);
    udp_init(udp);
}

// Both families keep the port at the same place.
static struct sockaddr_storage with_port(struct sockaddr_storage address, uint16_t port) {
    if (address.ss_family == AF_INET6)
        ((struct sockaddr_in6 *)&address)->sin6_port = htons(port);
    else
        ((struct sockaddr_in *)&address)->sin_port = htons(port);
    return address;
}

static void open_socket(struct udp *udp, const struct sockaddr_storage *server) {
    if (udp->fd >= 0 && !memcmp(&udp->server, server, sizeof *server))
        return;
    if (udp->fd >= 0)
        close(udp->fd);
    udp->server = *server;
    udp->fd = socket(server->ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    socklen_t size =
        server->ss_family == AF_INET6 ? sizeof(struct sockaddr_in6) : sizeof(struct sockaddr_in);
    if (udp->fd >= 0 && connect(udp->fd, (const struct sockaddr *)server, size)) {
        close(udp->fd);
        udp->fd = -1;
    }
}

void udp_take_keys(struct udp *udp, const struct sockaddr_storage *server,
                   const arthron_UdpKeys *keys) {
    struct sockaddr_storage address = with_port(*server, (uint16_t)keys->port);
    uint8_t epoch = (uint8_t)keys->epoch;
    open_socket(udp, &address);
    forget(&udp->before);
    if (udp->present.connection == keys->connection)
        udp->before = udp->present;
    else
        forget(&udp->present);
    udp->present = (struct udp_epoch){
        .connection = keys->connection,
        .to_server = seal_create(SEAL_TO_SERVER, epoch, keys->connection, keys->key_to_server,
                                 keys->iv_to_server),
        .to_station = seal_create(SEAL_TO_STATION, epoch, keys->connection, keys->key_to_station,
                                  keys->iv_to_station),
    };
}

enum udp_sent udp_send(struct udp *udp, const arthron_Frame *message) {
    uint8_t bytes[WIRE_DATAGRAM_MAX - SEAL_OVERHEAD], datagram[WIRE_DATAGRAM_MAX];
    size_t size;
    struct seal *seal = udp->present.to_server;
    arthron_Frame padded = *message;
    wire_frame_pad(&padded);
    if (udp->fd < 0 || !seal || seal_exhausted(seal) ||
        wire_encode_frame(&padded, bytes, sizeof bytes, &size) != RESULT_OK)
        return UDP_REFUSED;
    if (send(udp->fd, datagram, seal_seal(seal, bytes, size, datagram), 0) >= 0)
        return UDP_SENT;
    return errno == EAGAIN || errno == ENOBUFS ? UDP_FULL : UDP_REFUSED;
}

static bool open_reply(struct udp *udp, const uint8_t *datagram, size_t size,
                       arthron_Reply *out_reply) {
    uint8_t bytes[WIRE_DATAGRAM_MAX];
    size_t used;
    uint64_t sequence;
    struct udp_epoch *epochs[] = {&udp->present, &udp->before};
    for (int i = 0; i < 2; i++)
        if (epochs[i]->to_station &&
            seal_open(epochs[i]->to_station, datagram, size, bytes, &used, &sequence))
            return wire_decode_reply(bytes, used, out_reply, NULL) == RESULT_OK;
    return false;
}

bool udp_receive(struct udp *udp, arthron_Reply *out_reply) {
    uint8_t datagram[WIRE_DATAGRAM_MAX];
    ssize_t size;
    if (udp->fd < 0)
        return false;
    while ((size = recv(udp->fd, datagram, sizeof datagram, 0)) >= 0 || errno == EINTR)
        if (size >= 0 && open_reply(udp, datagram, (size_t)size, out_reply))
            return true;
    return false;
}
