// Bytes that are no change of a mesh, or just so, and what the decoder says to them. Every input
// lies in memory of just its size.
#include "test.h"
#include "wire/mesh_delta.h"

#include <stdlib.h>
#include <string.h>

// One triangle of three vertices, and a piece of one triangle.
// clang-format off
static const uint8_t good[] = {
    /*   0 base, number */ 0, 0,
    /*   2 freed */ 1, 5,
    /*   4 vertices */ 3,
    /*   5 */ 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    /*  18 */ 0, 0, 0, 128, 63, 0, 0, 0, 0, 0, 0, 0, 0,
    /*  31 */ 0, 0, 0, 0, 0, 0, 0, 128, 63, 0, 0, 0, 0,
    /*  44 made: head, label, corners */ 1, 1, 4, 0, 2, 2,
    /*  50 pieces */ 1,
    /*  51 volume, centroid */ 0, 0, 0, 64, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    /*  67 vertices */ 3,
    /*  68 */ 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    /*  80 */ 0, 0, 128, 63, 0, 0, 0, 0, 0, 0, 0, 0,
    /*  92 */ 0, 0, 0, 0, 0, 0, 128, 63, 0, 0, 0, 0,
    /* 104 triangles */ 1, 0, 2, 2,
    /* 108 hash */ 1, 2, 3, 4, 5, 6, 7, 8,
};
// clang-format on

// The good bytes with some of them, from `at` on, replaced by others.
struct row {
    const char *text; // of the error; NULL: good
    enum result result;
    size_t at, removed, put;
    const char *bytes;
};

#define GOOD(at, removed, bytes)                                                                   \
    { NULL, RESULT_OK, at, removed, sizeof bytes - 1, bytes }
#define BAD(text, result, at, removed, bytes)                                                      \
    { text, result, at, removed, sizeof bytes - 1, bytes }

static const struct row rows[] = {
    GOOD(0, 0, ""),
    GOOD(0, 2, "\xfe\xff\xff\xff\x0f\x00"),
    GOOD(0, 2, "\x00\xfe\xff\xff\xff\x0f"),
    GOOD(0, 1, "\x80\x00"), // longer than it need be
    BAD("is not above", RESULT_FORMAT, 0, 2, "\xff\xff\xff\xff\x0f\x00"),
    BAD("is not above", RESULT_FORMAT, 0, 2, "\x00\xff\xff\xff\xff\x0f"),
    BAD("a number beyond 32 bits", RESULT_FORMAT, 0, 1, "\x80\x80\x80\x80\x10"),
    BAD("a number beyond 32 bits", RESULT_FORMAT, 0, 1, "\x80\x80\x80\x80\x80\x00"),
    GOOD(2, 2, "\x00"),
    GOOD(2, 2, "\x02\x00\x00"),
    GOOD(2, 2, "\x01\xff\xff\x3f"), // the highest id
    BAD("freed triangles: id 1048576 is not below", RESULT_LIMIT, 2, 2, "\x01\x80\x80\x40"),
    BAD("freed triangles: id 1048576 is not below", RESULT_LIMIT, 2, 2, "\x02\xff\xff\x3f\x00"),
    BAD("freed triangles: id 5 is not above the one before", RESULT_FORMAT, 2, 2,
        "\x02\x05\xff\xff\xff\xff\x0f"),
    BAD("freed triangles: 200 of them do not fit", RESULT_FORMAT, 2, 1, "\xc8\x01"),
    BAD("freed triangles: 4294967295 of them", RESULT_FORMAT, 2, 1, "\xff\xff\xff\xff\x0f"),
    BAD("new vertices: 9 of them do not fit", RESULT_FORMAT, 4, 1, "\x09"),
    BAD("new vertices: 4294967295 of them", RESULT_FORMAT, 4, 1, "\xff\xff\xff\xff\x0f"),
    BAD("new vertices: id 1048576 is not below", RESULT_LIMIT, 5, 1, "\x80\x80\x40"),
    BAD("new vertices: id 1048576 is not below", RESULT_LIMIT, 31, 1, "\xfe\xff\x3f"),
    BAD("new vertices: a coordinate of 0", RESULT_FORMAT, 6, 4, "\x00\x00\xc0\x7f"),  // NaN
    BAD("new vertices: a coordinate of 0", RESULT_FORMAT, 10, 4, "\x00\x00\x80\x7f"), // infinity
    BAD("new vertices: a coordinate of 2", RESULT_FORMAT, 40, 4, "\x00\x00\x80\xff"),
    GOOD(40, 4, "\x00\x40\x1c\xc6"), // -10000
    BAD("new vertices: a coordinate of 2", RESULT_FORMAT, 40, 4, "\x01\x40\x1c\xc6"),
    BAD("made triangles: 18 of them do not fit", RESULT_FORMAT, 44, 1, "\x12"),
    BAD("made triangles: id 1048576 is not below", RESULT_LIMIT, 45, 1, "\x81\x80\x80\x01"),
    GOOD(45, 2, "\x00"), // no label of its own
    GOOD(46, 1, "\x01"), // label 4294967295
    BAD("made triangles: corner 4294967295 is", RESULT_LIMIT, 47, 1, "\x01"),
    BAD("made triangles: corner 1048576 is", RESULT_LIMIT, 49, 1, "\xfe\xff\x7f"),
    BAD("made triangles: corners 0, 0, 1 are", RESULT_FORMAT, 48, 1, "\x00"),
    BAD("made triangles: corners 0, 1, 1 are", RESULT_FORMAT, 49, 1, "\x00"),
    BAD("made triangles: corners 0, 1, 0 are", RESULT_FORMAT, 49, 1, "\x01"),
    BAD("pieces: 65 of them do not fit", RESULT_FORMAT, 50, 1, "\x41"),
    BAD("piece 0: its volume", RESULT_FORMAT, 51, 4, "\x00\x00\xc0\x7f"),
    BAD("piece 0: its volume", RESULT_FORMAT, 55, 4, "\x00\x00\x80\x7f"),
    BAD("piece 0: vertices: 5 of them do not fit", RESULT_FORMAT, 67, 1, "\x05"),
    BAD("piece 0: its volume", RESULT_FORMAT, 100, 4, "\x00\x00\x80\xff"),
    BAD("piece 0: triangles: 4 of them do not fit", RESULT_FORMAT, 104, 1, "\x04"),
    BAD("piece 0: corner 3 is not below 3", RESULT_LIMIT, 107, 1, "\x04"),
    BAD("piece 0: corners 0, 1, 0 are", RESULT_FORMAT, 107, 1, "\x01"),
    BAD("cut short", RESULT_FORMAT, 115, 1, ""),
};

static uint8_t *patched(const struct row *row, size_t *out_size) {
    *out_size = sizeof good - row->removed + row->put;
    uint8_t *bytes = malloc(*out_size);
    memcpy(bytes, good, row->at);
    memcpy(bytes + row->at, row->bytes, row->put);
    memcpy(bytes + row->at + row->put, good + row->at + row->removed,
           sizeof good - row->at - row->removed);
    return bytes;
}

static void bytes_that_are_no_change_are_refused_with_what_is_wrong(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct mesh_delta delta;
        struct error err = {0};
        size_t size, used;
        uint8_t *bytes = patched(&rows[i], &size);
        enum result result = mesh_delta_decode(bytes, size, &used, &delta, &err);
        if (result != rows[i].result || !strstr(err.text, rows[i].text ? rows[i].text : ""))
            fail_msg("row %zu: %s: %s", i, result_sentence(result), err.text);
        if (result == RESULT_OK)
            assert_int_equal(used, size);
        else
            assert_null(delta.made);
        mesh_delta_fini(&delta);
        free(bytes);
    }
}

static void sixty_five_pieces_are_too_many(void **state) {
    (void)state;
    uint8_t bytes[2000] = {0, 0, 0, 0, 0, 65};
    struct mesh_delta delta;
    struct error err = {0};
    size_t used;
    assert_int_equal(mesh_delta_decode(bytes, sizeof bytes, &used, &delta, &err), RESULT_LIMIT);
    assert_non_null(strstr(err.text, "65 pieces"));
    bytes[5] = 64;
    assert_int_equal(mesh_delta_decode(bytes, sizeof bytes, &used, &delta, &err), RESULT_OK);
    assert_int_equal(delta.piece_count, 64);
    mesh_delta_fini(&delta);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_that_are_no_change_are_refused_with_what_is_wrong),
        cmocka_unit_test(sixty_five_pieces_are_too_many),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
