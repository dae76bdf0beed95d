// Asks an OpenIGTLink server to send tracking data. Some send it to whoever connects, others (PLUS
// with TDATA, servers after the library's own example) only after STT_TDATA or STT_QTDATA. A server
// skips a request that it does not know. No sockets, no clock.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IGTL_REQUEST_BYTES 94
#define IGTL_COORDINATES_SIZE 33 // with the final 0

enum igtl_request_kind {
    IGTL_REQUEST_AUTO, // where nothing comes by itself: TDATA, then QTDATA, by turns
    IGTL_REQUEST_TDATA,
    IGTL_REQUEST_QTDATA,
    IGTL_REQUEST_NONE,
    IGTL_REQUEST_KIND_COUNT
};

struct igtl_request {
    enum igtl_request_kind kind;
    int interval_ms; // the shortest between two messages: OpenIGTLink's resolution
    char coordinates[IGTL_COORDINATES_SIZE];
    int64_t due_ns;               // when to ask, unless a pose comes before
    int count;                    // how often it was asked since poses last came
    enum igtl_request_kind asked; // TDATA or QTDATA, the last time; NONE: not yet
};

// A connection begins. kind, interval_ms and coordinates stay.
void igtl_request_begin(struct igtl_request *request, int64_t now_ns);

// Poses came.
void igtl_request_answered(struct igtl_request *request, int64_t now_ns);

// The bytes to send now; 0: none. It is asked again while nothing comes, for a server may have been
// switched on behind its port only later.
size_t igtl_request_next(struct igtl_request *request, int64_t now_ns,
                         uint8_t out[IGTL_REQUEST_BYTES]);

const char *igtl_request_name(enum igtl_request_kind kind); // "auto", "TDATA", "QTDATA", "none"
