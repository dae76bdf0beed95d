#include "encode.h"

#include "base/check.h"
#include "base/clock.h"

#include <openigtlink/igtl_header.h>
#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_qtdata.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
#include <openigtlink/igtl_util.h>
#include <string.h>

static const char *const type_names[] = {"TRANSFORM", "TDATA", "POSITION", "QTDATA"};

// Sizes of the four parts (12, content, 10, 8), message id; then content; then the index of one
// entry: lengths of key and value, encoding US-ASCII (3); then key and value.
static const uint8_t extended_header[12] = {0, 12, 0, 10, 0, 0, 0, 8};
static const uint8_t metadata[18] = {0, 1,   0,   6,   0,   3,   0,   0,   0,
                                     2, 'S', 't', 'a', 't', 'u', 's', 'O', 'K'};

static void to_matrix(pose p, float out[12]) {
    mat3 r = quat_to_mat3(p.rotation);
    for (int column = 0; column < 3; column++)
        for (int row = 0; row < 3; row++)
            out[3 * column + row] = (float)r.m[row][column];
    out[9] = (float)p.translation.x;
    out[10] = (float)p.translation.y;
    out[11] = (float)p.translation.z;
}

static void to_position(pose p, float out[7]) {
    const float values[7] = {(float)p.translation.x, (float)p.translation.y, (float)p.translation.z,
                             (float)p.rotation.x,    (float)p.rotation.y,    (float)p.rotation.z,
                             (float)p.rotation.w};
    memcpy(out, values, sizeof values);
}

static void copy_name(char *out, const char *name, size_t size) {
    memset(out, 0, size);
    memcpy(out, name, strnlen(name, size));
}

static size_t content_of(enum message_type type, const struct tracked_tool *tool, uint8_t *out) {
    float matrix[12], numbers[7];
    to_matrix(tool->T_tracker_tool, matrix);
    to_position(tool->T_tracker_tool, numbers);
    if (type == MESSAGE_TRANSFORM) {
        igtl_transform_convert_byte_order(matrix);
        memcpy(out, matrix, sizeof matrix);
        return sizeof matrix;
    }
    if (type == MESSAGE_POSITION) {
        igtl_position position;
        memcpy(&position, numbers, sizeof position);
        igtl_position_convert_byte_order(&position);
        memcpy(out, &position, sizeof position);
        return sizeof position;
    }
    if (type == MESSAGE_TDATA) {
        igtl_tdata_element element = {.type = IGTL_TDATA_TYPE_6D};
        copy_name(element.name, tool->name, sizeof element.name);
        memcpy(element.transform, matrix, sizeof matrix);
        igtl_tdata_convert_byte_order(&element, 1);
        memcpy(out, &element, sizeof element);
        return sizeof element;
    }
    igtl_qtdata_element element = {.type = IGTL_QTDATA_TYPE_6D};
    copy_name(element.name, tool->name, sizeof element.name);
    memcpy(element.position, numbers, 3 * sizeof *numbers);
    memcpy(element.quaternion, numbers + 3, 4 * sizeof *numbers);
    igtl_qtdata_convert_byte_order(&element, 1);
    memcpy(out, &element, sizeof element);
    return sizeof element;
}

// The content lies in its place, behind the header and what version 2 has before it.
static size_t finish_message(const char *type, int version, int64_t utc_ns, const char *device,
                             size_t content_size, uint8_t *out) {
    uint8_t *body = out + IGTL_HEADER_SIZE;
    size_t size = content_size;
    if (version > 1) {
        memcpy(body, extended_header, sizeof extended_header);
        size += sizeof extended_header;
        memcpy(body + size, metadata, sizeof metadata);
        size += sizeof metadata;
    }
    igtl_header header = {.version = (igtl_uint16)version, .body_size = size};
    copy_name(header.name, type, sizeof header.name);
    copy_name(header.device_name, device, sizeof header.device_name);
    header.timestamp = (uint64_t)(utc_ns / NS_PER_S) << 32 |
                       igtl_nanosec_to_frac((igtl_uint32)(utc_ns % NS_PER_S));
    header.crc = crc64(body, size, 0);
    igtl_header_convert_byte_order(&header);
    memcpy(out, &header, sizeof header);
    return sizeof header + size;
}

static uint8_t *content_in(uint8_t *out, int version) {
    return out + IGTL_HEADER_SIZE + (version > 1 ? sizeof extended_header : 0);
}

size_t encode_answer(const char *type, int header_version, const void *content, size_t size,
                     uint8_t out[ENCODE_ANSWER_MAX]) {
    CHECK(size <= ENCODE_ANSWER_MAX - 128);
    memcpy(content_in(out, header_version), content, size);
    return finish_message(type, header_version, 0, "Tracker", size, out);
}

static size_t encode_message(enum message_type type, int version, int64_t utc_ns,
                             const char *device, const struct tracked_tool *tools, int count,
                             uint8_t *out) {
    uint8_t *content = content_in(out, version);
    size_t size = 0;
    for (int i = 0; i < count; i++)
        size += content_of(type, &tools[i], content + size);
    return finish_message(type_names[type], version, utc_ns, device, size, out);
}

size_t encode_tools(enum message_type type, int version, int64_t utc_ns,
                    const struct tracked_tool *tools, int count, uint8_t out[ENCODE_BYTES_MAX]) {
    CHECK(count <= ENCODE_TOOLS_MAX);
    if (type == MESSAGE_TDATA || type == MESSAGE_QTDATA)
        return encode_message(type, version, utc_ns, "Tracker", tools, count, out);
    size_t size = 0;
    for (int i = 0; i < count; i++)
        size += encode_message(type, version, utc_ns, tools[i].name, &tools[i], 1, out + size);
    return size;
}
