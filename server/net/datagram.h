// One worker's socket for sealed pose datagrams (UDP). Everything here belongs to one thread.
//
// Unknown connection, bad tag, replay, foreign bytes: silence, and a count. A reply answers a
// frame, once, and is never longer than the datagram that brought it. A new source address counts
// only for the newest datagram of a connection; until the station has confirmed it over the control
// connection (UdpPath) it gets no more than DATAGRAM_UNCONFIRMED_REPLIES.
#pragma once

#include "wire/seal.h"
#include "wire/wire.h"

#define DATAGRAM_BATCH 32
#define DATAGRAM_CONNECTIONS_MAX 64
#define DATAGRAM_UNCONFIRMED_REPLIES 1024

struct datagram_endpoint;

// Binds address:port (address NULL for all). RESULT_IO names both.
enum result datagram_create(const char *address, int port, struct datagram_endpoint **out_endpoint,
                            struct error *err);
void datagram_destroy(struct datagram_endpoint **endpoint);
int datagram_fd(const struct datagram_endpoint *endpoint);   // to poll for reading
int datagram_port(const struct datagram_endpoint *endpoint); // the bound one

// Makes a connection, or its next epoch: random keys, which `out_keys` carries to the station. The
// epoch before stays good for 5 s. Replies go out in the epoch that the station last used. `user`
// comes back with each frame. At most DATAGRAM_CONNECTIONS_MAX connections at a time.
void datagram_new_epoch(struct datagram_endpoint *endpoint, uint32_t connection, void *user,
                        int64_t now_ns, arthron_UdpKeys *out_keys);

// True once an hour or almost 2^32 datagrams have gone by: call datagram_new_epoch.
bool datagram_epoch_is_old(const struct datagram_endpoint *endpoint, uint32_t connection,
                           int64_t now_ns);

void datagram_forget(struct datagram_endpoint *endpoint, uint32_t connection);

// The station answered a challenge over the control connection.
void datagram_confirm(struct datagram_endpoint *endpoint, uint32_t connection, uint64_t challenge);

struct datagram_in {
    uint32_t connection;
    void *user;
    int64_t received_ns;
    size_t size;             // of the datagram: a reply is never longer
    uint64_t path_challenge; // not 0: the address is new, send UdpPath with this
    arthron_Frame message;
};

// Receives what is there, at most DATAGRAM_BATCH, without waiting. Returns how many frames.
int datagram_receive(struct datagram_endpoint *endpoint, struct datagram_in *out_frames);

// Queues the reply to one of the frames (reply->frame_number) of the last datagram_receive, for the
// connection's present address; datagram_flush sends all that is queued. False where nothing is
// queued: no such frame, answered already, too long, or too much to an unconfirmed address.
bool datagram_reply(struct datagram_endpoint *endpoint, uint32_t connection,
                    const arthron_Reply *reply);
void datagram_flush(struct datagram_endpoint *endpoint);

struct datagram_counts {
    uint64_t received, opened, sent;
    uint64_t strangers; // unknown connection or epoch, or not ours at all
    uint64_t forged;    // bad tag
    uint64_t replayed;  // seen before or too old
    uint64_t malformed; // sealed well, but not a frame
    uint64_t too_long;  // replies that would have amplified: not sent
};

struct datagram_counts datagram_counts(const struct datagram_endpoint *endpoint);
