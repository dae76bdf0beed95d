// A client of the tracker, and what it asked for.
#pragma once

#include "encode.h"
#include "igtl/framing.h"

#include <stdbool.h>

struct client {
    int fd;
    enum message_type
        offers;             // what it may ask for: TDATA and QTDATA (either), or one of the others
    int version;            // of the headers that we send
    bool asked;             // STT_TDATA or STT_QTDATA came, and no STP_ since; or a GET_
    bool once;              // a GET_ came: it gets one frame
    enum message_type type; // that it asked for
    int64_t interval_ns;    // the shortest between two messages
    int64_t sent_ns;
    struct igtl_framing framing;
};

// Reads what is there and answers requests. False: it has gone, or sends what is no OpenIGTLink.
bool client_read(struct client *client);

// Sends all of it, or returns false.
bool client_send(const struct client *client, const uint8_t *bytes, size_t size);
