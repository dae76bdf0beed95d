#include "openigtlink_stream.h"

#include "test.h"

#include <openigtlink/igtl_transform.h>
#include <openigtlink/igtl_util.h>
#include <stdlib.h>
#include <string.h>

void append(struct bytes *out, const void *data, size_t size) {
    assert_true(out->size + size <= sizeof out->data);
    if (size)
        memcpy(out->data + out->size, data, size);
    out->size += size;
}

void append_message(struct bytes *out, int version, const char *type, const char *device,
                    const void *body, size_t size) {
    igtl_header header = {.version = (igtl_uint16)version, .body_size = size};
    memcpy(header.name, type, strlen(type));
    memcpy(header.device_name, device, strlen(device));
    header.crc = crc64((unsigned char *)body, size, 0);
    igtl_header_convert_byte_order(&header);
    append(out, &header, sizeof header);
    append(out, body, size);
}

const float quarter_turn[12] = {0, 1, 0, -1, 0, 0, 0, 0, 1, 10, 20, 30};

void append_matrix(struct bytes *out, const float matrix[12]) {
    float copy[12];
    memcpy(copy, matrix, sizeof copy);
    igtl_transform_convert_byte_order(copy);
    append_message(out, 1, "TRANSFORM", "probe", copy, sizeof copy);
}

void assert_quarter_turn(pose p) {
    assert_vec3_near(pose_apply(p, (vec3){1, 2, 3}), ((vec3){8, 21, 33}), 1e-5);
}

void feed(struct igtl_stream *stream, const uint8_t *data, size_t size, struct report *r) {
    while (size) {
        // A copy of exactly this size, so that reading past it is seen.
        uint8_t *copy = malloc(size);
        enum igtl_event event;
        struct igtl_message message;
        memcpy(copy, data, size);
        size_t taken = igtl_stream_feed(stream, copy, size, &event, &message, &r->err);
        free(copy);
        assert_true(taken <= size);
        data += taken;
        size -= taken;
        r->poses += event == IGTL_POSES;
        r->skipped += event == IGTL_SKIPPED;
        r->refused += event == IGTL_REFUSED;
        r->broken += event == IGTL_BROKEN;
        if (event != IGTL_NOTHING && r->count < 512)
            r->events[r->count++] = event;
        if (event == IGTL_POSES || event == IGTL_SENSOR || event == IGTL_STRING)
            r->last = message;
        if (event == IGTL_BROKEN)
            return;
        assert_true(taken > 0);
    }
}

struct report report_of(const struct bytes *bytes) {
    static struct igtl_stream stream;
    struct report r = {0};
    igtl_stream_init(&stream);
    feed(&stream, bytes->data, bytes->size, &r);
    return r;
}
