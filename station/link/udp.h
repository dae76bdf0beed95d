// The station's end of the pose datagrams: one connected UDP socket, and the keys of the present
// epoch and the one before. Belongs to one thread; never waits.
#pragma once

#include "wire/seal.h"
#include "wire/wire.h"

#include <sys/socket.h>

struct udp_epoch {
    uint32_t connection;
    struct seal *to_server, *to_station; // NULL: no keys
};

struct udp {
    int fd; // -1: closed
    struct sockaddr_storage server;
    struct udp_epoch present, before;
};

void udp_init(struct udp *udp); // closed
void udp_close(struct udp *udp);

// Keys for a connection to the host `server` (its port is not used). Keys of the same connection
// are its next epoch: what was sealed under the one before still opens.
void udp_take_keys(struct udp *udp, const struct sockaddr_storage *server,
                   const arthron_UdpKeys *keys);

enum udp_sent { UDP_SENT, UDP_FULL, UDP_REFUSED };

// Pads, seals and sends. UDP_FULL: try later; UDP_REFUSED: this path does not work now.
enum udp_sent udp_send(struct udp *udp, const arthron_Frame *message);

// The next reply that is there and opens; false: none.
bool udp_receive(struct udp *udp, arthron_Reply *out_reply);
