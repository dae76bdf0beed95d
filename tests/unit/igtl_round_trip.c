// What one side of OpenIGTLink writes, the other one reads: requests by the server, and what a
// server sends by the station's own driver.

#include "base/clock.h"
#include "igtl/client.h"
#include "igtl/query.h"
#include "igtl/request.h"
#include "igtl/stream.h"
#include "random.h"
#include "test.h"

#include <string.h>

static const int trials = 300;

static int random_below(struct random *random, int limit) {
    return (int)(random_bits(random) % (uint64_t)limit);
}

// Printable, with any length up to the longest.
static void random_name(struct random *random, char out[IGTL_DEVICE_SIZE]) {
    int length = 1 + random_below(random, IGTL_DEVICE_SIZE - 1);
    memset(out, 0, IGTL_DEVICE_SIZE);
    for (int i = 0; i < length; i++)
        out[i] = (char)('!' + random_below(random, '~' - '!'));
}

// ---- requests -----------------------------------------------------------------------------------

static struct igtl_framing framing;

// The next message of `bytes`, as a server reads it.
static size_t read_query(const uint8_t *bytes, size_t size, struct igtl_query *out,
                         struct igtl_frame *out_frame) {
    enum igtl_framing_event event;
    struct error err;
    size_t taken = igtl_framing_feed(&framing, bytes, size, &event, out_frame, &err);
    assert_int_equal(IGTL_FRAMING_MESSAGE, event);
    assert_ok(igtl_query_read(out_frame, out, &err));
    return taken;
}

static void a_start_is_read_as_it_was_meant(void **state) {
    (void)state;
    struct random random = {1};
    for (int i = 0; i < trials; i++) {
        bool quaternions = i % 2;
        struct igtl_request request = {.kind =
                                           quaternions ? IGTL_REQUEST_QTDATA : IGTL_REQUEST_TDATA,
                                       .interval_ms = random_below(&random, 1 << 20)};
        uint8_t bytes[IGTL_REQUEST_BYTES_MAX];
        struct igtl_query query;
        struct igtl_frame frame;
        random_name(&random, request.device);
        igtl_request_begin(&request, 0);
        igtl_request_heard(&request, 1 + i % 3);
        igtl_request_next(&request, 0, bytes); // a greeting goes first
        size_t size = igtl_request_next(&request, 4 * NS_PER_S, bytes);
        igtl_framing_init(&framing);
        assert_int_equal(size, read_query(bytes, size, &query, &frame));
        assert_int_equal(1 + i % 3, frame.version);
        assert_int_equal(IGTL_QUERY_START, query.kind);
        assert_int_equal(quaternions ? IGTL_TYPE_QTDATA : IGTL_TYPE_TDATA, query.type);
        assert_int_equal(request.interval_ms, query.interval_ms);
        assert_string_equal(request.device, query.device);
    }
}

static void each_tool_that_is_asked_for_is_read(void **state) {
    (void)state;
    struct random random = {2};
    for (int i = 0; i < trials; i++) {
        bool position = i % 2;
        struct igtl_request request = {.kind = position ? IGTL_REQUEST_POSITION
                                                        : IGTL_REQUEST_TRANSFORM,
                                       .tool_count = 1 + random_below(&random, 16)};
        uint8_t bytes[IGTL_REQUEST_BYTES_MAX];
        struct igtl_query query;
        struct igtl_frame frame;
        for (int k = 0; k < request.tool_count; k++)
            random_name(&random, request.tools[k].name);
        igtl_request_begin(&request, 0);
        igtl_request_heard(&request, 1 + i % 3);
        igtl_request_next(&request, 0, bytes);
        size_t size = igtl_request_next(&request, 4 * NS_PER_S, bytes), at = 0;
        igtl_framing_init(&framing);
        for (int k = 0; k < request.tool_count; k++) {
            at += read_query(bytes + at, size - at, &query, &frame);
            assert_int_equal(IGTL_QUERY_GET, query.kind);
            assert_int_equal(position ? IGTL_TYPE_POSITION : IGTL_TYPE_TRANSFORM, query.type);
            assert_string_equal(request.tools[k].name, query.device);
        }
        assert_int_equal(size, at);
    }
}

// ---- what a server sends ------------------------------------------------------------------------

static struct served served;

static struct igtl_poses random_set(struct random *random) {
    struct igtl_poses set = {.utc_ns = random_below(random, 1 << 30) * NS_PER_S,
                             .count = 1 + random_below(random, IGTL_POSES_MAX)};
    for (int i = 0; i < set.count; i++) {
        struct igtl_pose *p = &set.poses[i];
        random_name(random, p->name);
        p->validity = VALIDITY_OK;
        p->utc_ns = random_below(random, 1 << 30) * NS_PER_S + random_below(random, 999999999);
        p->T_world_body = random_pose(random, 900);
    }
    return set;
}

static void assert_pose(const struct igtl_pose *want, const struct igtl_tool *got) {
    assert_string_equal(want->name, got->name);
    assert_vec3_near(want->T_world_body.translation, got->T_tracker_tool.translation, 1e-4);
    assert_near(quat_angle(want->T_world_body.rotation, got->T_tracker_tool.rotation), 0, 1e-6);
}

static void say(struct igtl_client *client, int version, const char *type) {
    struct igtl_head head = {.version = version, .type = type, .device = ""};
    struct error err;
    uint8_t bytes[128];
    assert_ok(igtl_client_hear(client, bytes, igtl_message_finish(&head, 0, bytes), &err));
}

// All that comes is poses of the set, in its order.
static void assert_read(struct igtl_client *client, const struct igtl_poses *set, int version) {
    static struct igtl_stream stream;
    static struct igtl_message message;
    const uint8_t *bytes;
    int tools = 0;
    igtl_stream_init(&stream);
    for (size_t size; (size = igtl_client_next(client, 1, &bytes));)
        while (size) {
            enum igtl_event event;
            struct error err;
            size_t taken = igtl_stream_feed(&stream, bytes, size, &event, &message, &err);
            bytes += taken;
            size -= taken;
            if (event != IGTL_POSES)
                continue; // the answer to a start
            assert_int_equal(version, message.version);
            int64_t stamp_ns = message.names_tools ? set->utc_ns : set->poses[tools].utc_ns;
            assert_int_equal(stamp_ns, message.stamp_ns);
            for (int i = 0; i < message.count; i++)
                assert_pose(&set->poses[tools++], &message.tools[i]);
        }
    assert_int_equal(set->count, tools);
}

static void the_stations_driver_reads_every_type_in_every_version(void **state) {
    (void)state;
    static const char *const starts[] = {"GET_CAPABIL", "STT_TDATA", "STT_QTDATA"};
    struct random random = {3};
    for (int i = 0; i < trials; i++) {
        struct igtl_client *client = igtl_client_create(&served, 1);
        struct igtl_poses set = random_set(&random);
        int version = 1 + i % 3;
        say(client, version, starts[i / 3 % 3]);
        served_put_poses(&served, &set, 1);
        assert_read(client, &set, version);
        igtl_client_destroy(&client);
        served = (struct served){0};
    }
}

static void the_stations_driver_reads_the_status(void **state) {
    (void)state;
    static struct igtl_stream stream;
    static struct igtl_message message;
    struct igtl_state paused = {.code = 13, .text = "paused"};
    for (int version = 1; version <= 3; version++) {
        struct igtl_client *client = igtl_client_create(&served, 1);
        enum igtl_event event;
        struct error err;
        const uint8_t *bytes;
        say(client, version, "GET_STATUS");
        served_put_state(&served, &paused);
        size_t size = igtl_client_next(client, 1, &bytes);
        igtl_stream_init(&stream);
        assert_int_equal(size, igtl_stream_feed(&stream, bytes, size, &event, &message, &err));
        assert_int_equal(IGTL_STATUS, event);
        assert_int_equal(13, message.status);
        assert_string_equal("paused", message.status_text);
        igtl_client_destroy(&client);
    }
}

// ---- metadata -----------------------------------------------------------------------------------

static void a_content_is_found_whatever_metadata_is_behind_it(void **state) {
    (void)state;
    static uint8_t bytes[8192], content[1024];
    struct random random = {4};
    for (int i = 0; i < trials; i++) {
        char texts[2 * IGTL_METADATA_MAX][IGTL_DEVICE_SIZE];
        struct igtl_metadata metadata[IGTL_METADATA_MAX];
        struct igtl_head head = {.version = 1 + i % 3,
                                 .type = "ANYTHING",
                                 .device = "x",
                                 .stamp = random_bits(&random),
                                 .metadata_count = random_below(&random, IGTL_METADATA_MAX + 1),
                                 .metadata = metadata};
        struct igtl_content found;
        struct igtl_frame frame;
        struct error err;
        enum igtl_framing_event event;
        size_t size = (size_t)random_below(&random, sizeof content);
        for (int k = 0; k < head.metadata_count; k++) {
            random_name(&random, texts[2 * k]);
            random_name(&random, texts[2 * k + 1]);
            metadata[k] = (struct igtl_metadata){texts[2 * k], texts[2 * k + 1]};
        }
        for (size_t k = 0; k < size; k++)
            content[k] = (uint8_t)random_bits(&random);
        memcpy(bytes + igtl_message_content(head.version), content, size);
        size_t whole = igtl_message_finish(&head, size, bytes);
        assert_int_equal(whole, igtl_message_size(&head, size));
        igtl_framing_init(&framing);
        assert_int_equal(whole, igtl_framing_feed(&framing, bytes, whole, &event, &frame, &err));
        assert_int_equal(IGTL_FRAMING_MESSAGE, event);
        assert_true(frame.intact && frame.stamp == head.stamp);
        assert_ok(igtl_frame_content(&frame, &found, &err));
        assert_int_equal(size, found.size);
        assert_memory_equal(content, found.bytes, size);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_start_is_read_as_it_was_meant),
        cmocka_unit_test(each_tool_that_is_asked_for_is_read),
        cmocka_unit_test(the_stations_driver_reads_every_type_in_every_version),
        cmocka_unit_test(the_stations_driver_reads_the_status),
        cmocka_unit_test(a_content_is_found_whatever_metadata_is_behind_it),
    };
    return cmocka_run_group_tests_name("igtl_round_trip", tests, NULL, NULL);
}
