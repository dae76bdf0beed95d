// Cuts an OpenIGTLink byte stream into messages, whatever they are: bytes in, contents out, no
// sockets.
#pragma once

#include "base/result.h"
#include "igtl/message.h"

#include <openigtlink/igtl_header.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IGTL_BODY_MAX 65536        // of a message that is read
#define IGTL_SKIP_MAX (1ULL << 30) // of any message
#define IGTL_TYPE_SIZE 13          // with the final 0

// A name of at most `size` bytes without the blanks at its end; `out` has room for one byte more.
void igtl_copy_name(char *out, const char *name, size_t size);

enum igtl_framing_event {
    IGTL_FRAMING_PART,    // the message is not complete yet
    IGTL_FRAMING_MESSAGE, // *out_frame was written
    IGTL_FRAMING_BROKEN,  // no header, or an absurd length: where the next message starts is not
                          // known any more
};

// A whole message; its bytes are good until the next igtl_framing_feed.
struct igtl_frame {
    int version;
    bool known;  // version 1 to 3: the rest means what we think
    bool intact; // its checksum is right
    char type[IGTL_TYPE_SIZE];
    char device[IGTL_DEVICE_SIZE]; // without the blanks that some fill it up with
    uint64_t stamp;                // igtl_stamp_ns; 0: none
    uint64_t body_size;            // above IGTL_BODY_MAX its bytes were not kept
    const uint8_t *body;
};

// Without what stands before and behind it from version 2 on.
struct igtl_content {
    const uint8_t *bytes;
    size_t size;
    const char *device;   // the frame's
    const uint8_t *index; // of the metadata, which lie behind it (igtl/metadata.h)
    size_t index_size, metadata_size;
};

struct igtl_framing {
    igtl_header header;
    size_t header_used;
    uint64_t body_used, crc;
    uint8_t body[IGTL_BODY_MAX];
};

// Starts at a message's first byte.
void igtl_framing_init(struct igtl_framing *framing);

// Takes bytes up to the end of the current message, at most `size`, and returns how many. After
// IGTL_FRAMING_BROKEN, for which *err says why, nothing more is taken until igtl_framing_init.
size_t igtl_framing_feed(struct igtl_framing *framing, const uint8_t *bytes, size_t size,
                         enum igtl_framing_event *out_event, struct igtl_frame *out_frame,
                         struct error *err);

// The content of a frame of a known version. RESULT_LIMIT: its bytes were not kept. RESULT_FORMAT:
// the sizes in its extended header contradict the message's.
enum result igtl_frame_content(const struct igtl_frame *frame, struct igtl_content *out_content,
                               struct error *err);
