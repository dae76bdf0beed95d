// Messages that other people's programs made, from the shared data.

#include "openigtlink_stream.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>

static FILE *open_data(const char *folder, const char *name) {
    const char *data = getenv("ARTHRON_DATA");
    char path[512];
    snprintf(path, sizeof path, "%s/protocol/%s/%s", data ? data : DATA, folder, name);
    return fopen(path, "rb");
}

static bool load(const char *folder, const char *name, struct bytes *out) {
    FILE *file = open_data(folder, name);
    if (!file)
        return false;
    out->size = fread(out->data, 1, sizeof out->data, file);
    fclose(file);
    return true;
}

static void other_peoples_messages_are_read_or_skipped_by_type(void **state) {
    (void)state;
    static const struct {
        const char *file;
        enum igtl_event event;
        int tools;
    } rows[] = {
        {"command_v2.bin", IGTL_SKIPPED, 0},    {"image_v1.bin", IGTL_SKIPPED, 0},
        {"point_v1.bin", IGTL_SKIPPED, 0},      {"polydata_v1.bin", IGTL_SKIPPED, 0},
        {"position_v1.bin", IGTL_POSES, 1},     {"status_v1.bin", IGTL_STATUS, 0},
        {"string_v1.bin", IGTL_STRING, 0},      {"tdata_v1.bin", IGTL_POSES, 3},
        {"trajectory_v1.bin", IGTL_SKIPPED, 0}, {"transform_v1.bin", IGTL_POSES, 1},
        {"transform_v2.bin", IGTL_POSES, 1},
    };
    static struct bytes bytes, all;
    all.size = 0;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_true(load("openigtlink", rows[i].file, &bytes));
        struct report r = report_of(&bytes);
        if (r.count != 1 || r.events[0] != rows[i].event)
            fail_msg("%s: %d events, the first %d: %s", rows[i].file, r.count, r.events[0],
                     r.err.text);
        assert_int_equal(rows[i].tools, r.last.count);
        assert_int_equal(0, r.last.refused);
        append(&all, bytes.data, bytes.size);
    }
    struct report r = report_of(&all);
    assert_int_equal(11, r.count);
    for (int i = 0; i < 11; i++)
        assert_int_equal(rows[i].event, r.events[i]);
}

static void other_peoples_poses_have_the_values_that_their_source_gives(void **state) {
    (void)state;
    static struct bytes bytes;
    assert_true(load("openigtlink", "transform_v1.bin", &bytes));
    struct report r = report_of(&bytes);
    assert_string_equal("DeviceName", r.last.tools[0].name);
    vec3 place = {46.0531, 19.4709, 46.0531};
    assert_vec3_near(r.last.tools[0].T_tracker_tool.translation, place, 1e-3);
    assert_true(load("openigtlink", "tdata_v1.bin", &bytes));
    r = report_of(&bytes);
    assert_string_equal("Tracker0", r.last.tools[0].name);
    assert_string_equal("Tracker2", r.last.tools[2].name);
    assert_true(load("openigtlink", "position_v1.bin", &bytes));
    r = report_of(&bytes);
    assert_vec3_near(r.last.tools[0].T_tracker_tool.translation, place, 1e-3);
}

static void malformed_messages_are_refused_and_the_stream_goes_on(void **state) {
    (void)state;
    static const struct {
        const char *file;
        int events;
    } rows[] = {
        {"content/transform_body_47.bin", 1},
        {"framing_header/crc_mismatch.bin", 1},
        {"framing_header/truncated_57.bin", 0},
        {"framing_header/body_size_greater_than_buffer.bin", 0},
    };
    static struct bytes bytes;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_true(load("openigtlink_negative", rows[i].file, &bytes));
        struct report r = report_of(&bytes);
        assert_int_equal(rows[i].events, r.refused);
        assert_int_equal(rows[i].events, r.count);
        append_matrix(&bytes, quarter_turn);
        if (!rows[i].events)
            continue; // its missing bytes are taken from what follows: nothing can tell
        r = report_of(&bytes);
        assert_int_equal(1, r.refused);
        assert_int_equal(1, r.poses);
    }
}

// What is missing came as zeros: the message is refused, and its neighbour is read.
static void a_cut_message_that_is_filled_up_is_refused_and_the_stream_goes_on(void **state) {
    (void)state;
    static const uint8_t zeros[64];
    static struct bytes bytes;
    assert_true(
        load("openigtlink_negative", "framing_header/body_size_greater_than_buffer.bin", &bytes));
    append(&bytes, zeros, 48 - 10);
    append_matrix(&bytes, quarter_turn);
    struct report r = report_of(&bytes);
    assert_int_equal(2, r.count);
    assert_int_equal(IGTL_REFUSED, r.events[0]);
    assert_int_equal(IGTL_POSES, r.events[1]);
    assert_quarter_turn(r.last.tools[0].T_tracker_tool);
}

static const char *const vectors[] = {
    "command_v2.bin",    "image_v1.bin",     "point_v1.bin",     "polydata_v1.bin",
    "position_v1.bin",   "status_v1.bin",    "string_v1.bin",    "tdata_v1.bin",
    "trajectory_v1.bin", "transform_v1.bin", "transform_v2.bin",
};

static struct igtl_stream stream;

static void feed_in_pieces(const struct bytes *bytes, size_t piece, struct report *r) {
    for (size_t at = 0; at < bytes->size; at += piece)
        feed(&stream, bytes->data + at, bytes->size - at < piece ? bytes->size - at : piece, r);
}

static void pieces_of_any_size_give_the_same_messages(void **state) {
    (void)state;
    static const size_t pieces[] = {1, 2, 57, 58, 59, 1000};
    static struct bytes all, bytes;
    all.size = 0;
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
        assert_true(load("openigtlink", vectors[i], &bytes));
        append(&all, bytes.data, bytes.size);
    }
    struct report whole = report_of(&all);
    for (size_t i = 0; i < sizeof pieces / sizeof *pieces; i++) {
        struct report r = {0};
        igtl_stream_init(&stream);
        feed_in_pieces(&all, pieces[i], &r);
        assert_int_equal(whole.count, r.count);
        assert_memory_equal(whole.events, r.events, (size_t)whole.count * sizeof *r.events);
    }
}

// One bit of the body is wrong: the checksum tells, and the next message is read.
static void
a_flipped_bit_in_a_message_that_is_read_is_refused_and_the_stream_goes_on(void **state) {
    (void)state;
    static const char *const read[] = {"position_v1.bin", "tdata_v1.bin", "transform_v1.bin",
                                       "transform_v2.bin"};
    static struct bytes bytes;
    for (size_t i = 0; i < sizeof read / sizeof *read; i++) {
        assert_true(load("openigtlink", read[i], &bytes));
        size_t size = bytes.size;
        append_matrix(&bytes, quarter_turn);
        for (size_t bit = 8 * 58; bit < 8 * size; bit += 5) {
            bytes.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
            struct report r = report_of(&bytes);
            if (r.count != 2 || r.refused != 1 || r.poses != 1)
                fail_msg("%s, bit %zu: %d refused, %d read", read[i], bit, r.refused, r.poses);
            bytes.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        }
    }
}

// A connection that ends in the middle of a message leaves nothing behind for the next one.
static void after_a_cut_at_any_byte_a_new_connection_reads(void **state) {
    (void)state;
    static struct bytes bytes, good;
    good.size = 0;
    append_matrix(&good, quarter_turn);
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
        assert_true(load("openigtlink", vectors[i], &bytes));
        for (size_t size = 1; size < bytes.size; size += 1 + size / 100) {
            struct report r = {0};
            igtl_stream_init(&stream);
            feed(&stream, bytes.data, size, &r);
            assert_int_equal(0, r.count);
            igtl_stream_init(&stream);
            feed(&stream, good.data, good.size, &r);
            assert_int_equal(1, r.poses);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(other_peoples_messages_are_read_or_skipped_by_type),
        cmocka_unit_test(other_peoples_poses_have_the_values_that_their_source_gives),
        cmocka_unit_test(malformed_messages_are_refused_and_the_stream_goes_on),
        cmocka_unit_test(a_cut_message_that_is_filled_up_is_refused_and_the_stream_goes_on),
        cmocka_unit_test(pieces_of_any_size_give_the_same_messages),
        cmocka_unit_test(a_flipped_bit_in_a_message_that_is_read_is_refused_and_the_stream_goes_on),
        cmocka_unit_test(after_a_cut_at_any_byte_a_new_connection_reads),
    };
    static struct bytes bytes;
    if (!load("openigtlink", "transform_v1.bin", &bytes)) {
        printf("skipped: no shared data (ARTHRON_DATA)\n");
        return 77;
    }
    return cmocka_run_group_tests_name("openigtlink_vectors", tests, NULL, NULL);
}
