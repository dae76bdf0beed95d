// A piece of a mesh as a control message. Every input lies in memory of just its size.
#include "test.h"
#include "wire/wire.h"

#include <stdlib.h>
#include <string.h>

static arthron_MeshChunk chunk, back;
static uint8_t bytes[WIRE_CHUNK_MAX];

// The second of three.
static void fill(void) {
    chunk = (arthron_MeshChunk){.group = "meniscus",
                                .base = 6,
                                .number = 9,
                                .size = 2 * WIRE_CHUNK_DATA + 1,
                                .hash = 0x123456789abcdef0,
                                .index = 1,
                                .data.size = WIRE_CHUNK_DATA};
    for (int i = 0; i < WIRE_CHUNK_DATA; i++)
        chunk.data.bytes[i] = (uint8_t)(i * 7);
}

static size_t encode(void) {
    size_t size = 0;
    assert_int_equal(wire_encode_chunk(&chunk, bytes, sizeof bytes, &size), RESULT_OK);
    return size;
}

static enum result decode(const uint8_t *data, size_t size, struct error *err) {
    uint8_t *exact = malloc(size);
    memcpy(exact, data, size);
    enum result result = wire_decode_chunk(exact, size, &back, err);
    free(exact);
    return result;
}

static void a_chunk_comes_back_as_it_went(void **state) {
    (void)state;
    fill();
    size_t size = encode();
    assert_true(wire_is_chunk(bytes, size));
    assert_int_equal(decode(bytes, size, NULL), RESULT_OK);
    assert_memory_equal(&back, &chunk, sizeof chunk);
}

static void the_longest_chunk_is_within_its_limit(void **state) {
    (void)state;
    fill();
    memset(chunk.group, 'g', sizeof chunk.group - 1);
    chunk.base = UINT32_MAX - 1;
    chunk.number = UINT32_MAX;
    chunk.size = WIRE_MESH_MAX;
    chunk.index = WIRE_MESH_MAX / WIRE_CHUNK_DATA - 1;
    chunk.hash = UINT64_MAX;
    size_t size = encode(), shorter;
    assert_int_equal(decode(bytes, size, NULL), RESULT_OK);
    assert_int_equal(wire_encode_chunk(&chunk, bytes, size - 1, &shorter), RESULT_LIMIT);
}

// As protobuf says: a Control whose field 15 is the chunk.
static void a_chunk_is_a_control_message_by_the_schema(void **state) {
    (void)state;
    static const uint8_t expected[] = "\x7a\x18\x0a\x02mm\x10\x01\x18\x02\x20\x03"
                                      "\x29\x08\x07\x06\x05\x04\x03\x02\x01\x3a\x03"
                                      "abc";
    chunk = (arthron_MeshChunk){.group = "mm", .base = 1, .number = 2, .size = 3};
    chunk.hash = 0x0102030405060708;
    chunk.data.size = 3;
    memcpy(chunk.data.bytes, "abc", 3);
    size_t size = encode();
    assert_int_equal(size, sizeof expected - 1);
    assert_memory_equal(bytes, expected, size);
}

static void what_reads_control_messages_refuses_a_chunk(void **state) {
    (void)state;
    static arthron_Control message;
    struct error err;
    chunk = (arthron_MeshChunk){.group = "m", .number = 1, .size = 1, .data.size = 1};
    size_t size = encode();
    assert_int_equal(wire_decode_control(bytes, size, &message, &err), RESULT_FORMAT);
    assert_non_null(strstr(err.text, "a piece of a mesh"));
    assert_false(wire_is_chunk(bytes, 0));
    assert_false(wire_is_chunk((const uint8_t *)"\x22\x00", 2));
}

enum field { GROUP, BASE, NUMBER, SIZE, INDEX, DATA };

static void a_chunk_that_contradicts_itself_is_refused(void **state) {
    (void)state;
    static const struct {
        enum field field;
        uint32_t value;
        enum result result;
        const char *text;
    } rows[] = {
        {BASE, 0, RESULT_OK, ""},
        {BASE, 8, RESULT_OK, ""},
        {BASE, 9, RESULT_FORMAT, "number 9 is not above base 9"},
        {NUMBER, 0, RESULT_FORMAT, "number 0 is not above base 6"},
        {GROUP, 0, RESULT_FORMAT, "its group has no name"},
        {SIZE, 0, RESULT_LIMIT, "0 bytes, 1 to 67108864"},
        {SIZE, WIRE_CHUNK_DATA, RESULT_FORMAT, "piece 1 of 32768 bytes"},
        {SIZE, WIRE_CHUNK_DATA + 1, RESULT_FORMAT, "piece 1 has 32768 bytes, not 1"},
        {SIZE, 2 * WIRE_CHUNK_DATA, RESULT_OK, ""},
        {SIZE, WIRE_MESH_MAX, RESULT_OK, ""},
        {SIZE, WIRE_MESH_MAX + 1, RESULT_LIMIT, "67108865 bytes"},
        {SIZE, UINT32_MAX, RESULT_LIMIT, "4294967295 bytes"},
        {INDEX, 2, RESULT_FORMAT, "piece 2 has 32768 bytes, not 1"},
        {INDEX, 3, RESULT_FORMAT, "piece 3 of 65537 bytes"},
        {INDEX, UINT32_MAX, RESULT_FORMAT, "piece 4294967295 of 65537 bytes"},
        {DATA, 0, RESULT_FORMAT, "piece 1 has 0 bytes, not 32768"},
        {DATA, WIRE_CHUNK_DATA - 1, RESULT_FORMAT, "piece 1 has 32767 bytes, not 32768"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct error err = {0};
        fill();
        if (rows[i].field == GROUP)
            chunk.group[0] = '\0';
        else if (rows[i].field == DATA)
            chunk.data.size = (pb_size_t)rows[i].value;
        else
            *(uint32_t *[]){[BASE] = &chunk.base,
                            [NUMBER] = &chunk.number,
                            [SIZE] = &chunk.size,
                            [INDEX] = &chunk.index}[rows[i].field] = rows[i].value;
        size_t size = encode();
        enum result result = decode(bytes, size, &err);
        if (result != rows[i].result || !strstr(err.text, rows[i].text))
            fail_msg("row %zu: %s: %s", i, result_sentence(result), err.text);
    }
}

static void bytes_that_are_no_chunk_are_refused(void **state) {
    (void)state;
    static uint8_t long_one[WIRE_CHUNK_MAX + 1] = {0x7a, 0xfc, 0x81, 0x02};
    static const struct {
        const char *what, *bytes;
        size_t size;
    } rows[] = {
        {"nothing in it", "\x7a\x00", 2},
        {"no length", "\x7a", 1},
        {"longer than the bytes", "\x7a\x05\x18\x01", 4},
        {"a group of 64 letters",
         "\x7a\x42\x0a\x40gggggggggggggggggggggggggggggggggggggggggggggggggggggggggggggggg", 68},
        {"bytes behind it", "\x7a\x0a\x0a\x01m\x18\x01\x20\x01\x3a\x01x\x22\x00", 14},
        {"a number of 33 bits", "\x7a\x06\x18\x80\x80\x80\x80\x10", 8},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (decode((const uint8_t *)rows[i].bytes, rows[i].size, NULL) != RESULT_FORMAT)
            fail_msg("%s: accepted", rows[i].what);
    assert_int_equal(
        decode((const uint8_t *)"\x7a\x0a\x0a\x01m\x18\x01\x20\x01\x3a\x01x", 12, NULL), RESULT_OK);
    assert_int_equal(decode(long_one, sizeof long_one, NULL), RESULT_LIMIT);
    fill();
    size_t size = encode();
    for (size_t cut = 1; cut < size; cut += cut < 100 || size - cut < 100 ? 1 : 97)
        assert_int_equal(decode(bytes, cut, NULL), RESULT_FORMAT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_chunk_comes_back_as_it_went),
        cmocka_unit_test(the_longest_chunk_is_within_its_limit),
        cmocka_unit_test(a_chunk_is_a_control_message_by_the_schema),
        cmocka_unit_test(what_reads_control_messages_refuses_a_chunk),
        cmocka_unit_test(a_chunk_that_contradicts_itself_is_refused),
        cmocka_unit_test(bytes_that_are_no_chunk_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
