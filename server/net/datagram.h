// One worker's socket for sealed pose datagrams (UDP). Everything here belongs to one thread.
//
// Datagrams with an unknown connection, a bad tag, a replayed sequence or foreign bytes are counted
// and get no answer. A reply answers one frame, once, and is never longer than the frame's
// datagram. Only the newest datagram of a connection can change its address. Until the station has
// confirmed a new address over the control connection (UdpPath), at most
// DATAGRAM_UNCONFIRMED_REPLIES go there. The challenge that it confirms comes in the replies to
// that address, so that only who gets them can; older stations get it over the control connection.
#pragma once

#include "wire/seal.h"
#include "wire/wire.h"

#define DATAGRAM_BATCH 32
#define DATAGRAM_UNCONFIRMED_REPLIES 1024

struct datagram_endpoint;

// Binds address:port (address NULL for all). RESULT_IO names both. connections: places for them.
enum result datagram_create(const char *address, int port, int connections,
                            struct datagram_endpoint **out_endpoint, struct error *err);
void datagram_destroy(struct datagram_endpoint **endpoint);
int datagram_fd(const struct datagram_endpoint *endpoint);   // to poll for reading
int datagram_port(const struct datagram_endpoint *endpoint); // the bound one

// A new random id for the connection at this place: one at a time has it.
uint32_t datagram_new_id(const struct datagram_endpoint *endpoint, int place);

// Makes a connection, or its next epoch, with random keys for the station in *out_keys. The epoch
// before stays valid for 5 s. Replies use the station's last epoch. Each frame carries `user`.
void datagram_new_epoch(struct datagram_endpoint *endpoint, uint32_t connection, void *user,
                        int64_t now_ns, arthron_UdpKeys *out_keys);

// True once an hour or almost 2^32 datagrams have gone by: call datagram_new_epoch.
bool datagram_epoch_is_old(const struct datagram_endpoint *endpoint, uint32_t connection,
                           int64_t now_ns);

// From now on challenges go in replies, and datagram_in has none.
void datagram_challenge_in_replies(struct datagram_endpoint *endpoint, uint32_t connection);

void datagram_forget(struct datagram_endpoint *endpoint, uint32_t connection);

// The station answered a challenge over the control connection.
void datagram_confirm(struct datagram_endpoint *endpoint, uint32_t connection, uint64_t challenge);

struct datagram_in {
    uint32_t connection;
    void *user;
    int64_t received_ns;
    size_t size;             // of the datagram: a reply is never longer
    uint64_t path_challenge; // not 0: the address is new, send UdpPath with this
    bool is_valid;           // false: of the frame there is only its number
    struct frame frame;
};

// Receives the waiting datagrams, at most DATAGRAM_BATCH, without waiting. Returns the number of
// frames.
int datagram_receive(struct datagram_endpoint *endpoint, struct datagram_in *out_frames);

// Queues the reply to one of the frames (reply->frame_number) of the last datagram_receive, for the
// connection's present address; datagram_flush sends all queued replies. False if it is not queued:
// there is no such frame, it is answered already, the reply is too long, or an unconfirmed address
// has had too many.
bool datagram_reply(struct datagram_endpoint *endpoint, uint32_t connection,
                    const arthron_Reply *reply);
void datagram_flush(struct datagram_endpoint *endpoint);

struct datagram_counts {
    uint64_t received, opened, sent;
    uint64_t strangers; // unknown connection or epoch, or foreign bytes
    uint64_t forged;    // bad tag
    uint64_t replayed;  // seen before or too old
    uint64_t malformed; // sealed well, but not a frame
    uint64_t too_long;  // replies that would have amplified: not sent
};

struct datagram_counts datagram_counts(const struct datagram_endpoint *endpoint);
