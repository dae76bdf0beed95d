// Byte streams made for tests, and what a stream says about them.
#pragma once

#include "igtl/stream.h"

#include <stddef.h>
#include <stdint.h>

struct bytes {
    uint8_t data[1 << 17];
    size_t size;
};

void append(struct bytes *out, const void *data, size_t size);

// A whole message, its checksum right.
void append_message(struct bytes *out, int version, const char *type, const char *device,
                    const void *body, size_t size);

// A TRANSFORM of version 1 by the tool "probe".
void append_matrix(struct bytes *out, const float matrix[12]);

// A rotation by 90 degrees about z and a translation, as the protocol's 12 numbers.
extern const float quarter_turn[12];
void assert_quarter_turn(pose p);

// The events in their order, NOTHING left out.
struct report {
    int count, poses, skipped, refused, broken;
    enum igtl_event events[512];
    struct igtl_message last;
    struct error err;
};

void feed(struct igtl_stream *stream, const uint8_t *data, size_t size, struct report *r);
struct report report_of(const struct bytes *bytes);
