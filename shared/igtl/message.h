// A message of OpenIGTLink as bytes: header, and from version 2 on what stands before and behind
// its content (igtl/content.h). Bytes only: no sockets, no clock.
#pragma once

#include <stddef.h>
#include <stdint.h>

#define IGTL_DEVICE_SIZE 21   // a device's name with the final 0: 20 bytes on the wire
#define IGTL_NEWEST_VERSION 3 // of a header; the oldest is 1
#define IGTL_METADATA_MAX 32

struct igtl_metadata {
    const char *key, *value; // US-ASCII, at most 65535 bytes
};

struct igtl_head {
    int version;        // 1 to 3, or what a test wants; above 1 the message has what version 2 has
    const char *type;   // at most 12 bytes count
    const char *device; // at most 20 bytes count
    uint64_t stamp;     // igtl_stamp; 0: none
    uint32_t id;        // from version 2 on; 0: none
    int metadata_count; // at most IGTL_METADATA_MAX; in version 1 there is none
    const struct igtl_metadata *metadata;
};

// A time as OpenIGTLink has it: seconds since 1970 UTC, and 2^-32 of a second.
uint64_t igtl_stamp(int64_t utc_ns); // not before 1970
int64_t igtl_stamp_ns(uint64_t stamp);

// Where the content begins, and how many bytes the whole message has.
size_t igtl_message_content(int version);
size_t igtl_message_size(const struct igtl_head *head, size_t content_size);

// The content lies in `message` already, at igtl_message_content. Writes all else, and returns
// igtl_message_size.
size_t igtl_message_finish(const struct igtl_head *head, size_t content_size, uint8_t *message);
