// A pose datagram: as it came, under a key that is known; then the same bytes as the content of a
// good one, for nothing but that gets past the seal.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "wire/seal.h"
#include "wire/wire.h"

#include <string.h>

static const uint8_t key[SEAL_KEY_SIZE] = "arthron fuzzing", iv[SEAL_IV_SIZE] = "a known one";

static size_t encode(const struct frame *frame, uint8_t *out_data) {
    static arthron_Frame message;
    size_t size;
    wire_frame_from(frame, &message);
    CHECK(wire_encode_frame(&message, out_data, arthron_Frame_size, &size) == RESULT_OK);
    return size;
}

static void check_same(const struct frame *a, const struct frame *b) {
    uint8_t of_a[arthron_Frame_size], of_b[arthron_Frame_size];
    CHECK(frame_is_valid(a));
    size_t size = encode(a, of_a);
    CHECK(encode(b, of_b) == size && memcmp(of_a, of_b, size) == 0);
}

static void decode(const uint8_t *message, size_t size) {
    static arthron_Frame read;
    static arthron_Reply reply;
    struct frame frame, expected;
    struct error err;
    enum result result = wire_decode_frame(message, size, &read, &err);
    if (result == RESULT_OK)
        result = wire_frame_to(&read, &expected, &err);
    CHECK(wire_read_frame(message, size, &frame, &err) == result);
    if (result == RESULT_OK)
        check_same(&frame, &expected);
    wire_decode_reply(message, size, &reply, &err);
}

static void as_it_came(const uint8_t *data, size_t size) {
    uint8_t message[WIRE_DATAGRAM_MAX];
    struct seal_header header;
    size_t used;
    uint64_t sequence;
    if (!seal_peek(data, size, &header))
        return;
    struct seal *seal = seal_create(header.direction, header.epoch, header.connection, key, iv);
    if (seal_open(seal, data, size, message, &used, &sequence)) {
        CHECK(used == size - SEAL_OVERHEAD && sequence == header.sequence);
        CHECK(seal_has_seen(seal, sequence));
        CHECK(!seal_open(seal, data, size, message, &used, &sequence));
        decode(data + SEAL_HEADER_SIZE, used);
    }
    seal_destroy(&seal);
}

static void as_content(const uint8_t *data, size_t size) {
    uint8_t datagram[WIRE_DATAGRAM_MAX], message[WIRE_DATAGRAM_MAX];
    size_t used;
    uint64_t sequence;
    struct seal *out = seal_create(SEAL_TO_SERVER, 1, 7, key, iv);
    struct seal *in = seal_create(SEAL_TO_SERVER, 1, 7, key, iv);
    size_t sealed = seal_seal(out, data, size, datagram);
    CHECK(seal_open(in, datagram, sealed, message, &used, &sequence));
    CHECK(used == size && sequence == 0 && memcmp(message, data, size) == 0);
    decode(message, used);
    seal_destroy(&out);
    seal_destroy(&in);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size > WIRE_DATAGRAM_MAX)
        return 0;
    as_it_came(data, size);
    if (size && size <= WIRE_DATAGRAM_MAX - SEAL_OVERHEAD)
        as_content(data, size);
    return 0;
}
