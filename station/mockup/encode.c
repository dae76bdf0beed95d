#include "encode.h"

#include "base/check.h"
#include "igtl/content.h"
#include "igtl/sensor.h"

#include <stdio.h>
#include <string.h>

static const char *const type_names[] = {"TRANSFORM", "TDATA", "POSITION", "QTDATA"};

static struct igtl_head head_of(const char *type, int version, const char *device, int64_t utc_ns) {
    return (struct igtl_head){
        .version = version, .type = type, .device = device, .stamp = igtl_stamp(utc_ns)};
}

static size_t content_of(enum message_type type, const struct tracked_tool *tool, uint8_t *out) {
    switch (type) {
    case MESSAGE_TRANSFORM:
        return igtl_write_transform(tool->T_tracker_tool, out);
    case MESSAGE_POSITION:
        return igtl_write_position(tool->T_tracker_tool, out);
    case MESSAGE_TDATA:
        return igtl_write_tdata(tool->name, tool->T_tracker_tool, out);
    default:
        return igtl_write_qtdata(tool->name, tool->T_tracker_tool, out);
    }
}

size_t encode_answer(const char *type, int header_version, const void *content, size_t size,
                     uint8_t out[ENCODE_ANSWER_MAX]) {
    CHECK(size <= ENCODE_ANSWER_MAX - 128);
    struct igtl_head head = head_of(type, header_version, "Tracker", 0);
    memcpy(out + igtl_message_content(header_version), content, size);
    return igtl_message_finish(&head, size, out);
}

size_t encode_force(int header_version, int64_t utc_ns, const char *device, double newtons,
                    uint8_t out[ENCODE_ANSWER_MAX]) {
    struct igtl_head head = head_of("SENSOR", header_version, device, utc_ns);
    const struct igtl_sensor sensor = {1, IGTL_UNIT_NEWTON, {newtons}};
    size_t size = igtl_write_sensor(&sensor, out + igtl_message_content(header_version));
    return igtl_message_finish(&head, size, out);
}

static size_t encode_message(enum message_type type, int version, int64_t utc_ns,
                             const char *device, const struct tracked_tool *tools, int count,
                             uint8_t *out) {
    struct igtl_head head = head_of(type_names[type], version, device, utc_ns);
    uint8_t *content = out + igtl_message_content(version);
    struct igtl_metadata states[ENCODE_TOOLS_MAX];
    char keys[ENCODE_TOOLS_MAX][64];
    size_t size = 0;
    for (int i = 0; i < count; i++) {
        bool named = type == MESSAGE_TDATA || type == MESSAGE_QTDATA;
        size += content_of(type, &tools[i], content + size);
        snprintf(keys[i], sizeof keys[i], "%.40sStatus", named ? tools[i].name : "Transform");
        states[i] = (struct igtl_metadata){keys[i], tools[i].missing ? "MISSING" : "OK"};
    }
    head.metadata_count = count;
    head.metadata = states;
    return igtl_message_finish(&head, size, out);
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
