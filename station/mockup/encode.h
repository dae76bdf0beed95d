// Tracked tools as OpenIGTLink messages.
#pragma once

#include "base/pose.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum message_type { MESSAGE_TRANSFORM, MESSAGE_TDATA, MESSAGE_POSITION, MESSAGE_QTDATA };

#define ENCODE_TOOLS_MAX 16
#define ENCODE_BYTES_MAX (ENCODE_TOOLS_MAX * 256)

struct tracked_tool {
    const char *name; // at most 20 bytes count
    pose T_tracker_tool;
    bool missing; // its state says so, from version 2 on
};

#define ENCODE_ANSWER_MAX 256

// A message from the device "Tracker" without a stamp, its content at most 128 bytes.
size_t encode_answer(const char *type, int header_version, const void *content, size_t size,
                     uint8_t out[ENCODE_ANSWER_MAX]);

// A SENSOR of one number in newtons.
size_t encode_force(int header_version, int64_t utc_ns, const char *device, double newtons,
                    uint8_t out[ENCODE_ANSWER_MAX]);

// TRANSFORM and POSITION: one message a tool, TDATA and QTDATA: one message of all. Header version
// 1, or 2 and 3 with an extended header and metadata that tell each tool's state as PLUS does.
// Returns the bytes written.
size_t encode_tools(enum message_type type, int header_version, int64_t utc_ns,
                    const struct tracked_tool *tools, int count, uint8_t out[ENCODE_BYTES_MAX]);
