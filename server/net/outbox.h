// The messages that wait for one peer: a bounded queue that grows from small, and beside it the
// newest Resection of each group. All calls are under one lock of the owner.
#pragma once

#include "wire/wire.h"

#include <libwebsockets.h>

struct outgoing {
    bool last; // the connection closes behind it
    uint32_t size;
    uint8_t header[LWS_PRE]; // libwebsockets writes its own before the bytes
    uint8_t bytes[WIRE_CONTROL_MAX];
};

void outgoing_encode(const arthron_Control *message, struct outgoing *out);

struct outbox;

struct outbox *outbox_create(void);
void outbox_destroy(struct outbox **outbox); // NULL inside is fine

enum outbox_put {
    OUTBOX_QUEUED,
    OUTBOX_DROPPED,  // full; a Reply, Ping or Pong, of which a newer one will come
    OUTBOX_OVERFLOWN // full, and the peer must not miss the message
};

// encoded: the same message. Replies, pings and pongs leave room for messages that the peer must
// not miss. A Resection replaces the one of its group that still waits. It goes after all messages,
// but before a SessionChange that comes after it.
enum outbox_put outbox_put(struct outbox *outbox, const arthron_Control *message,
                           const struct outgoing *encoded);

bool outbox_waits(const struct outbox *outbox); // whether there is a message

// The next message; false: none waits.
bool outbox_take(struct outbox *outbox, struct outgoing *out);
