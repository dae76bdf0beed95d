// What the room writes, beside what the library's own functions write and read.

#include "igtl/content.h"
#include "random.h"
#include "test.h"

#include <openigtlink/igtl_capability.h>
#include <openigtlink/igtl_polydata.h>
#include <string.h>

static uint8_t out[1 << 16];

enum { VERTICES = 40, TRIANGLES = 77 };

static void make_mesh(struct random *random, float positions[3 * VERTICES],
                      uint32_t triangles[3 * TRIANGLES]) {
    for (int i = 0; i < 3 * VERTICES; i++)
        positions[i] = (float)(100 * random_between(random, 0, 1) - 50);
    for (int i = 0; i < 3 * TRIANGLES; i++)
        triangles[i] = (uint32_t)(random_between(random, 0, 1) * VERTICES);
}

static void a_mesh_has_the_bytes_that_the_library_writes(void **state) {
    (void)state;
    static uint8_t theirs[sizeof out];
    float positions[3 * VERTICES];
    uint32_t triangles[3 * TRIANGLES], polygons[4 * TRIANGLES];
    struct random random = {3};
    make_mesh(&random, positions, triangles);
    for (int i = 0; i < TRIANGLES; i++) {
        polygons[4 * i] = 3;
        memcpy(polygons + 4 * i + 1, triangles + 3 * i, 3 * sizeof *triangles);
    }
    igtl_polydata_info info;
    igtl_polydata_init_info(&info);
    info.header.npoints = VERTICES;
    info.header.npolygons = TRIANGLES;
    info.header.size_polygons = sizeof polygons;
    info.points = positions;
    info.polygons = polygons;
    size_t size = igtl_polydata_size(VERTICES, TRIANGLES);
    assert_int_equal(size, igtl_polydata_get_size(&info, IGTL_TYPE_PREFIX_NONE));
    assert_int_equal(1, igtl_polydata_pack(&info, theirs, IGTL_TYPE_PREFIX_NONE));
    assert_int_equal(size, igtl_write_polydata(positions, VERTICES, triangles, TRIANGLES, out));
    assert_memory_equal(theirs, out, size);
    size = igtl_write_polydata(NULL, 0, NULL, 0, out);
    assert_int_equal(igtl_polydata_size(0, 0), size);
}

static void the_library_reads_capabilities(void **state) {
    (void)state;
    static const char *const types[] = {"TRANSFORM", "GET_POLYDATA", "STATUS"};
    igtl_capability_info info;
    size_t size = igtl_write_capability(types, 3, out);
    igtl_capability_init_info(&info);
    assert_int_equal(1, igtl_capability_unpack(out, &info, size));
    assert_int_equal(3, info.ntypes);
    for (int i = 0; i < 3; i++)
        assert_memory_equal(types[i], info.typenames[i], strlen(types[i]));
    igtl_capability_free_info(&info);
}

// ---- texts --------------------------------------------------------------------------------------

// Behind the header: 2 bytes of encoding, 2 of length.
static void a_text_is_cut_between_two_characters(void **state) {
    (void)state;
    char text[IGTL_TEXT_SIZE + 64];
    for (size_t before = 0; before < 5; before++) {
        memset(text, 'x', before);
        for (size_t at = before; at + 3 < sizeof text; at += 3)
            memcpy(text + at, "\u20ac", 4);
        size_t size = igtl_write_string(text, out), length = size - 4;
        assert_int_equal(106, out[0] << 8 | out[1]);
        assert_int_equal(length, out[2] << 8 | out[3]);
        assert_true(length < IGTL_TEXT_SIZE && length + 3 >= IGTL_TEXT_SIZE);
        assert_int_equal(0, (length - before) % 3);
        assert_memory_equal(text, out + 4, length);
    }
    igtl_write_string("plain", out);
    assert_int_equal(3, out[0] << 8 | out[1]);
}

static void a_status_has_a_text_of_any_length_and_its_end(void **state) {
    (void)state;
    char text[400];
    memset(text, 'x', sizeof text);
    for (size_t length = 0; length < sizeof text; length++) {
        text[length] = 0;
        size_t size = igtl_write_status(4, -2, "a name that is far too long", text, out);
        size_t kept = length < IGTL_TEXT_SIZE ? length : IGTL_TEXT_SIZE - 1;
        assert_int_equal(30 + kept + 1, size);
        assert_int_equal(0, out[size - 1]);
        text[length] = 'x';
    }
    assert_memory_equal("a name that is far t", out + 10, 20);
}

// ---- times --------------------------------------------------------------------------------------

// A stamp counts 2^-32 of a second, which is finer than a nanosecond.
static void a_time_comes_back_from_its_stamp(void **state) {
    (void)state;
    struct random random = {11};
    for (int i = 0; i < 10000; i++) {
        int64_t ns = (int64_t)(random_between(&random, 0, 1) * 4e18);
        assert_int_equal(ns, igtl_stamp_ns(igtl_stamp(ns)));
    }
    assert_int_equal(0, igtl_stamp(0));
    assert_int_equal(0, igtl_stamp(-5));
    assert_int_equal(UINT64_C(1700000000) << 32 | 0x80000000, igtl_stamp(1700000000500000000));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mesh_has_the_bytes_that_the_library_writes),
        cmocka_unit_test(the_library_reads_capabilities),
        cmocka_unit_test(a_text_is_cut_between_two_characters),
        cmocka_unit_test(a_status_has_a_text_of_any_length_and_its_end),
        cmocka_unit_test(a_time_comes_back_from_its_stamp),
    };
    return cmocka_run_group_tests_name("igtl_contents", tests, NULL, NULL);
}
