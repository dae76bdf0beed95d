#include "../../station/mockup/encode.h"
#include "openigtlink_stream.h"
#include "random.h"
#include "test.h"

#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_tdata.h>
#include <string.h>

// ---- own messages -------------------------------------------------------------------------------

// What the mock-up writes, in every type and version, comes back within a float's resolution.
static void every_type_and_version_comes_back(void **state) {
    (void)state;
    struct random random = {7};
    for (int trial = 0; trial < 100; trial++)
        for (int type = MESSAGE_TRANSFORM; type <= MESSAGE_QTDATA; type++)
            for (int version = 1; version <= 3; version++) {
                static struct bytes bytes;
                struct tracked_tool tools[2] = {{"probe", random_pose(&random, 900)},
                                                {"a name of 20 bytes!!", random_pose(&random, 9)}};
                bytes.size = encode_tools((enum message_type)type, version, 1700000000123456789,
                                          tools, 2, bytes.data);
                struct report r = report_of(&bytes);
                bool list = type == MESSAGE_TDATA || type == MESSAGE_QTDATA;
                assert_int_equal(list ? 1 : 2, r.poses);
                assert_int_equal(r.poses, r.count);
                const struct igtl_tool *last = &r.last.tools[r.last.count - 1];
                assert_string_equal(tools[1].name, last->name);
                pose want = tools[1].T_tracker_tool, got = last->T_tracker_tool;
                assert_vec3_near(want.translation, got.translation, 1e-6);
                assert_near(quat_angle(want.rotation, got.rotation), 0, 1e-6);
                assert_true(pose_is_valid(got));
            }
}

static void messages_may_be_cut_anywhere(void **state) {
    (void)state;
    static struct bytes bytes;
    static struct igtl_stream stream;
    struct tracked_tool tools[2] = {{"probe", {{1, 0, 0, 0}, {1, 2, 3}}},
                                    {"punch", {{0, 1, 0, 0}, {4, 5, 6}}}};
    bytes.size = encode_tools(MESSAGE_TDATA, 2, 0, tools, 2, bytes.data);
    append_message(&bytes, 1, "COMMAND", "tracker", "some text", 9);
    append_matrix(&bytes, quarter_turn);
    append_message(&bytes, 1, "GET_TDATA", "tracker", NULL, 0);
    append_matrix(&bytes, quarter_turn);
    for (size_t cut = 0; cut <= bytes.size; cut++) {
        struct report r = {0};
        igtl_stream_init(&stream);
        feed(&stream, bytes.data, cut, &r);
        feed(&stream, bytes.data + cut, bytes.size - cut, &r);
        assert_int_equal(3, r.poses);
        assert_int_equal(2, r.skipped);
        assert_int_equal(5, r.count);
    }
    struct report r = {0};
    igtl_stream_init(&stream);
    for (size_t i = 0; i < bytes.size; i++)
        feed(&stream, bytes.data + i, 1, &r);
    assert_int_equal(5, r.count);
    assert_quarter_turn(r.last.tools[0].T_tracker_tool);
}

static void a_newer_version_does_not_poison_the_stream(void **state) {
    (void)state;
    static struct bytes bytes;
    bytes.size = 0;
    append_message(&bytes, 4, "TRANSFORM", "probe", quarter_turn, sizeof quarter_turn);
    append_message(&bytes, 0, "TRANSFORM", "probe", quarter_turn, sizeof quarter_turn);
    append_message(&bytes, 3, "TRANSFORMER", "probe", "x", 1);
    append_matrix(&bytes, quarter_turn);
    struct report r = report_of(&bytes);
    assert_int_equal(3, r.skipped);
    assert_int_equal(1, r.poses);
    assert_quarter_turn(r.last.tools[0].T_tracker_tool);
}

static void lengths_that_lie_are_refused(void **state) {
    (void)state;
    static const uint8_t zeros[20000];
    static const struct {
        int version;
        const char *type;
        uint8_t extended[12]; // in front of the zeros, from version 2 on
        size_t zeros;
    } rows[] = {
        {1, "TRANSFORM", {0}, 0},
        {1, "TRANSFORM", {0}, 49},
        {1, "POSITION", {0}, 0},
        {1, "POSITION", {0}, 13},
        {1, "POSITION", {0}, 29},
        {1, "POSITION", {0}, 20000},
        {1, "TDATA", {0}, 69},
        {1, "TDATA", {0}, 70 * (IGTL_TOOLS_MAX + 1)},
        {1, "QTDATA", {0}, 51},
        {1, "QTDATA", {0}, 50 * (IGTL_TOOLS_MAX + 1)},
        {2, "TRANSFORM", {0, 12, 0, 0, 0, 0, 0, 0}, 47},
        {2, "TRANSFORM", {0, 11, 0, 0, 0, 0, 0, 0}, 48},
        {2, "TRANSFORM", {0, 0, 0, 0, 0, 0, 0, 0}, 48},
        {2, "TRANSFORM", {0, 12, 0, 1, 0, 0, 0, 0}, 48},
        {2, "TRANSFORM", {0xff, 0xff, 0, 0, 0, 0, 0, 0}, 48},
        {3, "TDATA", {0, 12, 0xff, 0xff, 0, 0, 0, 0}, 70},
        {3, "QTDATA", {0, 12, 0, 0, 0xff, 0xff, 0xff, 0xff}, 50},
        {3, "QTDATA", {0, 12, 0xff, 0xff, 0xff, 0xff, 0, 0}, 50},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        static struct bytes bytes, body;
        bytes.size = body.size = 0;
        if (rows[i].version > 1)
            append(&body, rows[i].extended, 12);
        append(&body, zeros, rows[i].zeros);
        append_message(&bytes, rows[i].version, rows[i].type, "probe", body.data, body.size);
        append_matrix(&bytes, quarter_turn);
        struct report r = report_of(&bytes);
        if (r.refused != 1 || r.poses != 1)
            fail_msg("row %zu: %d refused, %d read", i, r.refused, r.poses);
        assert_true(strlen(r.err.text) > 0);
    }
}

static void a_body_too_short_for_an_extended_header_is_refused(void **state) {
    (void)state;
    for (size_t size = 0; size < 12; size++) {
        static struct bytes bytes;
        bytes.size = 0;
        append_message(&bytes, 2, "TRANSFORM", "probe", quarter_turn, size);
        append_matrix(&bytes, quarter_turn);
        struct report r = report_of(&bytes);
        assert_int_equal(1, r.refused);
        assert_int_equal(1, r.poses);
    }
}

static void a_known_type_of_absurd_size_is_skipped_by_its_length(void **state) {
    (void)state;
    static struct bytes bytes;
    static uint8_t body[IGTL_BODY_MAX + 1];
    bytes.size = 0;
    append_message(&bytes, 1, "TDATA", "tracker", body, sizeof body);
    append_matrix(&bytes, quarter_turn);
    struct report r = report_of(&bytes);
    assert_int_equal(1, r.refused);
    assert_int_equal(1, r.poses);
}

static void an_absurd_length_ends_the_stream(void **state) {
    (void)state;
    static struct bytes bytes;
    igtl_header header = {.version = 1, .name = "IMAGE", .body_size = IGTL_SKIP_MAX + 1};
    igtl_header_convert_byte_order(&header);
    bytes.size = 0;
    append(&bytes, &header, sizeof header);
    append_matrix(&bytes, quarter_turn);
    struct report r = report_of(&bytes);
    assert_int_equal(1, r.broken);
    assert_int_equal(1, r.count);
}

// A piece of the stream is missing: the rest is no message, whatever length it seems to have.
static void a_stream_out_of_step_is_noticed(void **state) {
    (void)state;
    static struct bytes bytes;
    bytes.size = 0;
    for (int i = 0; i < 6; i++)
        append_matrix(&bytes, quarter_turn);
    size_t one = bytes.size / 6;
    for (size_t missing = 1; missing < one; missing++) {
        struct report r = {0};
        static struct igtl_stream stream;
        igtl_stream_init(&stream);
        feed(&stream, bytes.data, one, &r);
        feed(&stream, bytes.data + one + missing, bytes.size - one - missing, &r);
        if (r.poses != 1 || r.broken != 1)
            fail_msg("%zu bytes are missing: %d poses, %d broken", missing, r.poses, r.broken);
    }
}

static void a_flipped_bit_is_never_taken_for_a_pose(void **state) {
    (void)state;
    static struct bytes good, bad;
    good.size = 0;
    append_matrix(&good, quarter_turn);
    size_t end = good.size;
    append_matrix(&good, quarter_turn);
    for (size_t bit = 8 * IGTL_HEADER_SIZE; bit < 8 * end; bit++) {
        bad = good;
        bad.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        struct report r = report_of(&bad);
        assert_int_equal(1, r.refused);
        assert_int_equal(1, r.poses);
    }
}

static void matrices_that_are_nearly_rotations_are_brought_to_the_nearest_one(void **state) {
    (void)state;
    struct random random = {8};
    for (int trial = 0; trial < 300; trial++) {
        static struct bytes bytes;
        mat3 r = quat_to_mat3(random_pose(&random, 1).rotation);
        // r · symmetric: r is its polar factor, whatever the symmetric part is.
        vec3 d = random_in_box(&random, 0.006), o = random_in_box(&random, 0.006);
        mat3 stretch = {{{1 + d.x, o.x, o.y}, {o.x, 1 + d.y, o.z}, {o.y, o.z, 1 + d.z}}};
        mat3 m = mat3_multiply(r, stretch);
        float numbers[12] = {0};
        for (int i = 0; i < 9; i++)
            numbers[i] = (float)m.m[i % 3][i / 3];
        bytes.size = 0;
        append_matrix(&bytes, numbers);
        struct report report = report_of(&bytes);
        assert_int_equal(1, report.poses);
        pose p = report.last.tools[0].T_tracker_tool;
        assert_near(quat_angle(p.rotation, quat_from_mat3(r)), 0, 1e-6);
    }
}

static void matrices_that_are_no_rotations_are_refused(void **state) {
    (void)state;
    static const float rows[][12] = {
        {0},
        {2, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0},
        {1, 0, 0, 0, 1, 0, 0, 0, -1, 0, 0, 0},
        {1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0},
        {1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0},
        {NAN, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0},
        {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, INFINITY, 0},
        {1e30f, 0, 0, 0, 1e30f, 0, 0, 0, 1e30f, 0, 0, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        static struct bytes bytes;
        bytes.size = 0;
        append_matrix(&bytes, rows[i]);
        struct report r = report_of(&bytes);
        assert_int_equal(1, r.refused);
        assert_int_equal(0, r.poses);
    }
}

// The protocol lets a POSITION leave out w of its quaternion, or all of it.
static void positions_may_leave_out_part_of_their_rotation(void **state) {
    (void)state;
    quat q = quat_from_axis_angle((vec3){0, 0, 1}, 1);
    igtl_position body = {{1, 2, 3}, {(float)q.x, (float)q.y, (float)q.z, (float)q.w}};
    igtl_position_convert_byte_order(&body);
    static const size_t sizes[] = {28, 24, 12};
    for (int i = 0; i < 3; i++) {
        static struct bytes bytes;
        bytes.size = 0;
        append_message(&bytes, 1, "POSITION", "probe", &body, sizes[i]);
        struct report r = report_of(&bytes);
        assert_int_equal(1, r.poses);
        pose p = r.last.tools[0].T_tracker_tool;
        assert_vec3_near(p.translation, ((vec3){1, 2, 3}), 1e-6);
        assert_near(quat_angle(p.rotation, sizes[i] > 12 ? q : quat_identity()), 0, 1e-6);
    }
}

static void quaternions_without_a_length_are_refused(void **state) {
    (void)state;
    static const float rows[][7] = {
        {1, 2, 3, 0, 0, 0, 0},        {1, 2, 3, 0, 0, 0, 3},   {1, 2, 3, NAN, 0, 0, 1},
        {1, 2, 3, 0, 0, INFINITY, 1}, {NAN, 2, 3, 0, 0, 0, 1},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        static struct bytes bytes;
        igtl_position body;
        memcpy(&body, rows[i], sizeof body);
        igtl_position_convert_byte_order(&body);
        bytes.size = 0;
        append_message(&bytes, 1, "POSITION", "probe", &body, sizeof body);
        struct report r = report_of(&bytes);
        assert_int_equal(1, r.refused);
        assert_int_equal(1, r.count);
    }
}

static void a_bad_tool_does_not_spoil_its_neighbours(void **state) {
    (void)state;
    static struct bytes bytes;
    igtl_tdata_element tools[4] = {{.name = "good", .type = IGTL_TDATA_TYPE_6D},
                                   {.name = "flat", .type = IGTL_TDATA_TYPE_6D},
                                   {.name = "odd", .type = 9},
                                   {.name = "place", .type = IGTL_TDATA_TYPE_3D}};
    memcpy(tools[0].transform, quarter_turn, sizeof quarter_turn);
    memcpy(tools[2].transform, quarter_turn, sizeof quarter_turn);
    igtl_tdata_convert_byte_order(tools, 4);
    bytes.size = 0;
    append_message(&bytes, 1, "TDATA", "tracker", tools, sizeof tools);
    struct report r = report_of(&bytes);
    assert_int_equal(1, r.poses);
    assert_int_equal(2, r.last.count);
    assert_int_equal(2, r.last.refused);
    assert_string_equal("good", r.last.tools[0].name);
    assert_quarter_turn(r.last.tools[0].T_tracker_tool);
    assert_string_equal("place", r.last.tools[1].name);
}

static void random_bytes_do_no_harm(void **state) {
    (void)state;
    struct random random = {9};
    for (int trial = 0; trial < 300; trial++) {
        static struct bytes bytes;
        struct tracked_tool tool = {"probe", pose_identity()};
        bytes.size = 0;
        while (bytes.size < 2000)
            bytes.size += encode_tools((enum message_type)(trial % 4), 1 + trial % 3, 0, &tool, 1,
                                       bytes.data + bytes.size);
        for (int i = 0; i < 1 + trial % 8; i++)
            bytes.data[random_bits(&random) % bytes.size] = (uint8_t)random_bits(&random);
        report_of(&bytes);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_and_version_comes_back),
        cmocka_unit_test(messages_may_be_cut_anywhere),
        cmocka_unit_test(a_newer_version_does_not_poison_the_stream),
        cmocka_unit_test(lengths_that_lie_are_refused),
        cmocka_unit_test(a_body_too_short_for_an_extended_header_is_refused),
        cmocka_unit_test(a_known_type_of_absurd_size_is_skipped_by_its_length),
        cmocka_unit_test(an_absurd_length_ends_the_stream),
        cmocka_unit_test(a_stream_out_of_step_is_noticed),
        cmocka_unit_test(a_flipped_bit_is_never_taken_for_a_pose),
        cmocka_unit_test(matrices_that_are_nearly_rotations_are_brought_to_the_nearest_one),
        cmocka_unit_test(matrices_that_are_no_rotations_are_refused),
        cmocka_unit_test(positions_may_leave_out_part_of_their_rotation),
        cmocka_unit_test(quaternions_without_a_length_are_refused),
        cmocka_unit_test(a_bad_tool_does_not_spoil_its_neighbours),
        cmocka_unit_test(random_bytes_do_no_harm),
    };
    return cmocka_run_group_tests_name("openigtlink", tests, NULL, NULL);
}
