// What waits to be said to one peer: a bounded queue of messages, and beside it the newest
// Resection of each group. One takes; the others put, and every put is under one lock of the
// owner's.
#pragma once

#include "base/ring.h"
#include "wire/wire.h"

#include <libwebsockets.h>
#include <pthread.h>

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
    OUTBOX_DROPPED,  // full, and it comes again anyway: a Reply, Ping or Pong
    OUTBOX_OVERFLOWN // full, and the peer must not miss it
};

// encoded: the message. Replies, pings and pongs leave room for what must not be missed. A
// Resection takes the place of the one of its group that still waits: it goes behind all messages,
// but before a SessionChange that comes after it.
enum outbox_put outbox_put(struct outbox *outbox, const arthron_Control *message,
                           const struct outgoing *encoded);

// The next message; false where there is none. lock: that of the puts, not held.
bool outbox_take(struct outbox *outbox, pthread_mutex_t *lock, struct outgoing *out);
