// Reads tracked poses and forces out of an OpenIGTLink byte stream: bytes in, messages out, no
// sockets.
//
// Read are TRANSFORM, TDATA, POSITION, QTDATA, SENSOR and STRING with header versions 1 to 3,
// STATUS, and what a server says to a request (igtl/request.h). Any other type or version is
// skipped by its length; a message whose checksum, length or values are wrong is refused; the
// stream goes on after both. Only what is no header, or an absurd length, ends it.
#pragma once

#include "base/pose.h"
#include "igtl/framing.h"
#include "igtl/sensor.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IGTL_TOOLS_MAX 64  // of one message
#define IGTL_TOOL_SIZE 128 // a tool's name with the final 0; what is longer is cut
#define IGTL_STATUS_OK 1
#define IGTL_STATUS_SIZE 64 // of its text, with the final 0
#define IGTL_STRING_SIZE 64 // too: more is left out

enum igtl_event {
    IGTL_NOTHING, // the message is not complete yet
    IGTL_POSES,   // *out_message was written
    IGTL_SENSOR,  // a device gives numbers
    IGTL_STRING,  // a device says something
    IGTL_DENIED,  // the server refuses a request
    IGTL_STATUS,  // the server tells how it is
    IGTL_SKIPPED, // a message of another type or version
    IGTL_REFUSED, // a malformed message
    IGTL_BROKEN,  // no header, or an absurd length: where the next message starts is not known
};

struct igtl_message {
    int64_t
        stamp_ns; // on the sender's clock, since 1970 UTC where it keeps to the standard; 0: none
    int count;
    int refused; // tools of this message whose pose is none, and that are not said to be unseen
    int version; // of its header, known or not
    char type[IGTL_TYPE_SIZE];          // in whose words
    char device[IGTL_DEVICE_SIZE];      // that sent it
    bool names_tools;                   // TDATA and QTDATA: its tools have names of their own
    bool denied;                        // IGTL_DENIED
    int status;                         // IGTL_STATUS: IGTL_STATUS_OK, or what is wrong
    char status_text[IGTL_STATUS_SIZE]; // in the server's words; what cannot be printed is '?'
    struct igtl_sensor sensor;          // IGTL_SENSOR
    char text[IGTL_STRING_SIZE];        // IGTL_STRING; what cannot be printed is '?'
    struct igtl_tool {
        char name[IGTL_TOOL_SIZE]; // TRANSFORM and POSITION: the device's, TDATA and QTDATA: the
                                   // tool's; the whole one where the metadata have it
        bool unseen;               // the metadata say that the pose means nothing
        bool has_pose;             // a valid one; else it is unseen
        pose T_tracker_tool;       // rotation: the identity where the message gives a position only
    } tools[IGTL_TOOLS_MAX];
};

struct igtl_stream {
    struct igtl_framing framing;
};

// Starts at a message's first byte.
void igtl_stream_init(struct igtl_stream *stream);

// Takes bytes up to the end of the current message, at most `size`, and returns how many. The event
// tells what that message is; *err says why for IGTL_REFUSED and IGTL_BROKEN. After IGTL_BROKEN
// nothing more is taken until igtl_stream_init. out_message and err may be written in any case.
size_t igtl_stream_feed(struct igtl_stream *stream, const uint8_t *bytes, size_t size,
                        enum igtl_event *out_event, struct igtl_message *out_message,
                        struct error *err);
