// Asks an OpenIGTLink server for poses. Some send them to whoever connects, others (PLUS with
// TDATA, servers after the library's own example) only after STT_TDATA or STT_QTDATA, others only
// one for each GET_. A server skips a request that it does not know. No sockets, no clock.
#pragma once

#include "igtl/content.h"
#include "igtl/stream.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IGTL_REQUEST_TOOLS_MAX 16
#define IGTL_REQUEST_BYTES_MAX ((IGTL_REQUEST_TOOLS_MAX + 2) * 80)

enum igtl_request_kind {
    IGTL_REQUEST_AUTO,      // where nothing comes by itself: the following, by turns
    IGTL_REQUEST_TDATA,     // STT_TDATA
    IGTL_REQUEST_QTDATA,    // STT_QTDATA
    IGTL_REQUEST_TRANSFORM, // GET_TRANS, again for each pose
    IGTL_REQUEST_POSITION,  // GET_POSITION, too
    IGTL_REQUEST_NONE,
    IGTL_REQUEST_KIND_COUNT
};

// A tool that GET_ names. Each is asked for again when it was answered: a server that is slower
// than its client has one request of each tool to answer, and not more and more.
struct igtl_request_tool {
    char name[IGTL_TOOL_SIZE];          // the first 20 bytes count
    int64_t asked_ns, since_ns, due_ns; // since_ns: the oldest that is unanswered
    int64_t usual_ns, pause_ns;         // usual_ns: of an answer, 0: not known
    int unanswered;
    bool heard; // since it was asked last
};

struct igtl_request {
    enum igtl_request_kind kind;
    int interval_ms; // the shortest between two messages: OpenIGTLink's resolution; 0: none
    char coordinates[IGTL_COORDINATES_SIZE];
    char device[IGTL_DEVICE_SIZE]; // that shall send TDATA or QTDATA; empty: any
    int tool_count;                // 0: whatever it has, and seldom
    struct igtl_request_tool tools[IGTL_REQUEST_TOOLS_MAX];

    int64_t due_ns;               // when to ask, unless a pose comes before
    int64_t answered_ns;          // the last time
    int count;                    // how often it was asked since poses last came
    enum igtl_request_kind asked; // the last time; NONE: not yet
    bool greeted;
    int pace;       // of TDATA or QTDATA: 0 none came, 1 seldom, 2 less than a second apart
    bool unlimited; // PLUS takes the resolution for seconds: it is asked for 0
    int version;    // of our headers: 1 until the server spoke, then its own
};

// A connection begins. What the caller wants stays.
void igtl_request_begin(struct igtl_request *request, int64_t now_ns);

// A message of this header version came, whatever it is.
void igtl_request_heard(struct igtl_request *request, int version);

// Poses came, or what else is wanted. Its type tells what it answers: it may be late.
void igtl_request_answered(struct igtl_request *request, const struct igtl_message *message,
                           int64_t now_ns);

// The bytes to send now; 0: none. The first are a GET_STATUS of version 2 that has no body, so that
// an old server can read it: PLUS and others send metadata only to a client that spoke version 2
// once. It is asked again while nothing comes, for a server may have been switched on behind its
// port only later. In `auto` it is asked for its STATUS, too.
size_t igtl_request_next(struct igtl_request *request, int64_t now_ns,
                         uint8_t out[IGTL_REQUEST_BYTES_MAX]);

// When there will be something to send; INT64_MAX: never.
int64_t igtl_request_due_ns(const struct igtl_request *request, int64_t now_ns);

// "auto", "TDATA", "QTDATA", "TRANSFORM", "POSITION", "none"
const char *igtl_request_name(enum igtl_request_kind kind);
