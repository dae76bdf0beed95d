// A tracker's OpenIGTLink stream, its checksums put right. In pieces it says what it says as a
// whole.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "igtl/stream.h"

#include <openigtlink/igtl_util.h>
#include <stdlib.h>
#include <string.h>

struct told {
    int events[IGTL_BROKEN + 1], tools;
};

static uint64_t big_endian(const uint8_t *bytes) {
    uint64_t value = 0;
    for (int i = 0; i < 8; i++)
        value = value << 8 | bytes[i];
    return value;
}

// The last 16 bytes of a header: size of the body, its checksum.
static void mend(uint8_t *data, size_t size) {
    for (size_t at = 0; size - at >= sizeof(igtl_header);) {
        uint8_t *end = data + at + sizeof(igtl_header);
        uint64_t body = big_endian(end - 16);
        if (body > size - at - sizeof(igtl_header))
            return;
        uint64_t crc = crc64(end, body, 0);
        for (int i = 0; i < 8; i++)
            end[i - 8] = (uint8_t)(crc >> (56 - 8 * i));
        at += sizeof(igtl_header) + (size_t)body;
    }
}

static struct told feed(const uint8_t *data, size_t size, size_t piece) {
    static struct igtl_stream stream;
    static struct igtl_message message;
    struct told told = {0};
    struct error err;
    igtl_stream_init(&stream);
    for (size_t at = 0; at < size && !told.events[IGTL_BROKEN];) {
        size_t given = size - at < piece ? size - at : piece;
        enum igtl_event event;
        size_t taken = igtl_stream_feed(&stream, data + at, given, &event, &message, &err);
        CHECK(taken <= given && (taken || event != IGTL_NOTHING));
        at += taken;
        told.events[event] += event != IGTL_NOTHING;
        CHECK(event != IGTL_STATUS ||
              strnlen(message.status_text, IGTL_STATUS_SIZE) < IGTL_STATUS_SIZE);
        double newtons = 1;
        CHECK(
            event != IGTL_SENSOR ||
            (message.sensor.count >= 0 && message.sensor.count <= IGTL_SENSOR_VALUES_MAX &&
             (igtl_unit_newtons(message.sensor.unit, &newtons, &err) != RESULT_OK || newtons > 0)));
        for (int i = 0; event == IGTL_POSES && i < message.count; i++, told.tools++)
            CHECK(pose_is_valid(message.tools[i].T_tracker_tool) &&
                  strlen(message.tools[i].name) < IGTL_TOOL_SIZE);
    }
    return told;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *mended = alloc(size + 1, 1);
    memcpy(mended, data, size);
    mend(mended, size);
    struct told whole = feed(mended, size, size), pieces = feed(mended, size, 7);
    CHECK(memcmp(&whole, &pieces, sizeof whole) == 0);
    feed(data, size, size);
    free(mended);
    return 0;
}
