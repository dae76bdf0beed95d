// Asks an OpenIGTLink server for poses. Some send them to whoever connects, others (PLUS with
// TDATA, servers after the library's own example) only after STT_TDATA or STT_QTDATA, others only
// one for each GET_. A server skips a request that it does not know. No sockets, no clock.
#pragma once

#include "device/igtl.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IGTL_REQUEST_TOOLS_MAX 16
#define IGTL_REQUEST_BYTES_MAX (IGTL_REQUEST_TOOLS_MAX * 80)
#define IGTL_COORDINATES_SIZE 33 // with the final 0

enum igtl_request_kind {
    IGTL_REQUEST_AUTO,      // where nothing comes by itself: the following, by turns
    IGTL_REQUEST_TDATA,     // STT_TDATA
    IGTL_REQUEST_QTDATA,    // STT_QTDATA
    IGTL_REQUEST_TRANSFORM, // GET_TRANS, again for each pose
    IGTL_REQUEST_POSITION,  // GET_POSITION, too
    IGTL_REQUEST_NONE,
    IGTL_REQUEST_KIND_COUNT
};

struct igtl_request {
    enum igtl_request_kind kind;
    int interval_ms; // the shortest between two messages: OpenIGTLink's resolution
    char coordinates[IGTL_COORDINATES_SIZE];
    char device[IGTL_NAME_SIZE]; // that shall send TDATA or QTDATA; empty: any
    int tool_count;              // 0: whatever it has
    char tools[IGTL_REQUEST_TOOLS_MAX][IGTL_NAME_SIZE]; // that GET_ names

    int64_t due_ns;                // when to ask, unless a pose comes before
    int64_t asked_ns, answered_ns; // the last time
    int count;                     // how often it was asked since poses last came
    enum igtl_request_kind asked;  // the last time; NONE: not yet
    int version;                   // of our headers: 1 until the server spoke, then its own
};

// A connection begins. What the caller wants stays.
void igtl_request_begin(struct igtl_request *request, int64_t now_ns);

// A message of this header version came, whatever it is.
void igtl_request_heard(struct igtl_request *request, int version);

// Poses came.
void igtl_request_answered(struct igtl_request *request, int64_t now_ns);

// The bytes to send now; 0: none. It is asked again while nothing comes, for a server may have been
// switched on behind its port only later. In `auto` it is asked for its STATUS, too.
size_t igtl_request_next(struct igtl_request *request, int64_t now_ns,
                         uint8_t out[IGTL_REQUEST_BYTES_MAX]);

// "auto", "TDATA", "QTDATA", "TRANSFORM", "POSITION", "none"
const char *igtl_request_name(enum igtl_request_kind kind);
