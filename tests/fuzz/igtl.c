// What a client of a server of OpenIGTLink sends, its checksums put right. Whatever it is, the
// server's bytes are whole messages of the version that the client speaks.
#include "base/check.h"
#include "base/log.h"
#include "fuzz/fuzz.h"
#include "igtl/big_endian.h"
#include "igtl/client.h"

#include <openigtlink/igtl_util.h>
#include <stdlib.h>
#include <string.h>

// The last 16 bytes of a header: size of the body, its checksum.
static void mend(uint8_t *data, size_t size) {
    for (size_t at = 0; size - at >= sizeof(igtl_header);) {
        uint8_t *end = data + at + sizeof(igtl_header);
        uint64_t body = big_endian_get(end - 16, 8);
        if (body > size - at - sizeof(igtl_header))
            return;
        big_endian_put(end - 8, crc64(end, body, 0), 8);
        at += sizeof(igtl_header) + (size_t)body;
    }
}

static struct served served;

static void fill(void) {
    struct igtl_poses set = {.utc_ns = 1, .count = 2};
    struct igtl_state state = {.code = 1, .text = "running"};
    struct served_bytes *content = served_bytes_create(igtl_polydata_size(0, 0));
    igtl_write_polydata(NULL, 0, NULL, 0, content->bytes);
    strcpy(served.device, "Arthron");
    for (int i = 0; i < set.count; i++)
        set.poses[i] = (struct igtl_pose){.name = "probe", .T_world_body = pose_identity()};
    set.poses[1].validity = VALIDITY_HELD;
    served_put_poses(&served, &set, 1);
    served_put_state(&served, &state);
    served_put_mesh(&served, 0, "meniscus\0\0\0\0\0\0\0\0\0\0\0\0", 1, content);
}

// All that waits.
static void take(struct igtl_client *client, struct igtl_framing *framing) {
    const uint8_t *bytes;
    for (size_t size; (size = igtl_client_next(client, 2, &bytes));)
        while (size) {
            enum igtl_framing_event event;
            struct igtl_frame frame;
            struct igtl_content content;
            struct error err;
            size_t taken = igtl_framing_feed(framing, bytes, size, &event, &frame, &err);
            CHECK(event != IGTL_FRAMING_BROKEN);
            CHECK(event != IGTL_FRAMING_MESSAGE ||
                  (frame.known && frame.intact &&
                   igtl_frame_content(&frame, &content, &err) == RESULT_OK));
            bytes += taken;
            size -= taken;
        }
    CHECK(!igtl_client_waits(client) && framing->header_used == 0);
}

static void converse(const uint8_t *data, size_t size, size_t piece) {
    static const struct served_string string = {.device = "events", .text = "cut"};
    static struct igtl_framing framing;
    struct error err;
    struct igtl_client *client = igtl_client_create(&served, 1);
    served_put_string(&served, &string);
    igtl_framing_init(&framing);
    for (size_t at = 0; at < size; at += piece) {
        size_t given = size - at < piece ? size - at : piece;
        if (igtl_client_hear(client, data + at, given, &err) != RESULT_OK)
            break;
        take(client, &framing);
    }
    igtl_client_destroy(&client);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint8_t *mended = alloc(size + 1, 1);
    log_set_level(LOG_ERROR);
    if (!served.set_count)
        fill();
    memcpy(mended, data, size);
    mend(mended, size);
    converse(mended, size, size ? size : 1);
    converse(mended, size, 61);
    converse(data, size, 4096);
    free(mended);
    return 0;
}
