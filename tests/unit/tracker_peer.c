// The tracker driver against a server of which the test writes each byte.
#include "base/clock.h"
#include "base/pose.h"
#include "drivers/device.h"
#include "drivers/drivers.h"
#include "drivers/socket.h"
#include "openigtlink_stream.h"
#include "test.h"

#include <fcntl.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

struct peer {
    int listener, fd; // the server's end
    void *device;
    struct device_reading reading; // the newest
    struct error err;
};

// Options end with a key NULL.
static void begin(struct peer *p, const struct device_option *options) {
    struct device_option all[16] = {{"address", NULL}};
    char address[64];
    uint16_t port;
    int count = 1;
    struct device_outputs outputs = {0};
    struct error err;
    memset(p, 0, sizeof *p);
    assert_ok(socket_listen("127.0.0.1:0", &p->listener, &port, &err));
    snprintf(address, sizeof address, "127.0.0.1:%u", port);
    all[0].value = address;
    while (options->key)
        all[count++] = *options++;
    const struct device_config config = {"camera", all, count};
    assert_ok(tracker_driver.create(&config, &p->device, &outputs, &err));
    assert_ok(tracker_driver.open(p->device, &err));
    p->fd = accept(p->listener, NULL, NULL);
    assert_true(p->fd >= 0);
}

static void end(struct peer *p) {
    tracker_driver.close(p->device);
    tracker_driver.destroy(p->device);
    close(p->fd);
    close(p->listener);
}

static enum result poll_once(struct peer *p) {
    p->reading = (struct device_reading){0};
    p->err = (struct error){{0}};
    return tracker_driver.poll(p->device, &p->reading, &p->err);
}

// What the driver makes of these bytes.
static enum result say(struct peer *p, const struct bytes *bytes) {
    assert_int_equal(send(p->fd, bytes->data, bytes->size, 0), bytes->size);
    return poll_once(p);
}

static void pause_ms(int ms) {
    const struct timespec time = {0, ms * 1000000L};
    nanosleep(&time, NULL);
}

// ---- messages -----------------------------------------------------------------------------------

static void put(struct bytes *out, uint64_t value, int size) {
    uint8_t bytes[8];
    for (int i = 0; i < size; i++)
        bytes[i] = (uint8_t)(value >> 8 * (size - 1 - i));
    append(out, bytes, (size_t)size);
}

// A message of version 2 after the protocol's text; `pairs` ends with NULL.
static void append_told(struct bytes *out, const char *type, const char *device,
                        const void *content, size_t size, const char *const *pairs) {
    static struct bytes body;
    int count = 0;
    size_t text = 0;
    for (; pairs[2 * count]; count++)
        text += strlen(pairs[2 * count]) + strlen(pairs[2 * count + 1]);
    body.size = 0;
    put(&body, 12, 2);
    put(&body, 2 + 8 * (unsigned)count, 2);
    put(&body, text, 4);
    put(&body, 0, 4);
    append(&body, content, size);
    put(&body, (unsigned)count, 2);
    for (int i = 0; i < count; i++) {
        put(&body, strlen(pairs[2 * i]), 2);
        put(&body, 3, 2);
        put(&body, strlen(pairs[2 * i + 1]), 4);
    }
    for (int i = 0; i < 2 * count; i++)
        append(&body, pairs[i], strlen(pairs[i]));
    append_message(out, 2, type, device, body.data, body.size);
}

static void matrix_at(float x, float out[12]) {
    static const float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    memcpy(out, identity, sizeof identity);
    out[9] = x;
}

static void append_transform(struct bytes *out, const char *device, float x,
                             const char *const *pairs) {
    float matrix[12];
    matrix_at(x, matrix);
    igtl_transform_convert_byte_order(matrix);
    append_told(out, "TRANSFORM", device, matrix, sizeof matrix, pairs);
}

static void append_tdata(struct bytes *out, int count, const char *const *names, const float *x,
                         const char *const *pairs) {
    igtl_tdata_element tools[4] = {0};
    for (int i = 0; i < count; i++) {
        memcpy(tools[i].name, names[i], strnlen(names[i], 20));
        tools[i].type = IGTL_TDATA_TYPE_6D;
        float matrix[12]; // the element's own is packed
        matrix_at(x[i], matrix);
        memcpy(tools[i].transform, matrix, sizeof matrix);
    }
    igtl_tdata_convert_byte_order(tools, count);
    append_told(out, "TDATA", "Tracker", tools, (size_t)count * sizeof *tools, pairs);
}

static void assert_at(const struct peer *p, enum channel channel, double x) {
    for (int i = 0; i < p->reading.count; i++) {
        const struct sample *s = &p->reading.samples[i];
        if (s->channel != channel)
            continue;
        assert_int_equal(s->validity, VALIDITY_OK);
        assert_near(s->T_mockup_body.translation.x, x, 1e-4);
        return;
    }
    fail_msg("no sample of %s: %s", channel_name(channel), p->err.text);
}

static void assert_lost(const struct peer *p, enum channel channel) {
    for (int i = 0; i < p->reading.count; i++)
        if (p->reading.samples[i].channel == channel) {
            assert_int_equal(p->reading.samples[i].validity, VALIDITY_LOST);
            return;
        }
    fail_msg("nothing of %s", channel_name(channel));
}

static const char *const no_pairs[] = {NULL};

// ---- tests --------------------------------------------------------------------------------------

// PLUS answers in the highest version that its client spoke, and version 1 has no metadata. A
// server of version 1 may not skip the body of a newer message: there is none.
static void a_client_speaks_version_2_first(void **state) {
    (void)state;
    static const struct {
        const char *request;
        bool greets;
    } rows[] = {{"auto", true}, {"TDATA", true}, {"TRANSFORM", true}, {"none", false}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct device_option options[] = {
            {"tool.probe", "P"}, {"request", rows[i].request}, {NULL, NULL}};
        struct peer p;
        uint8_t header[58] = {0}, none[8] = {0};
        begin(&p, options);
        poll_once(&p);
        ssize_t size = recv(p.fd, header, sizeof header, MSG_DONTWAIT);
        assert_int_equal(size, rows[i].greets ? 58 : -1);
        if (rows[i].greets) {
            assert_int_equal(header[0] << 8 | header[1], 2);
            assert_string_equal((const char *)header + 2, "GET_STATUS");
            assert_memory_equal(header + 42, none, 8);
        }
        end(&p);
    }
}

static void a_tool_that_is_said_to_be_missing_is_lost(void **state) {
    (void)state;
    static const char *const ok[] = {"TransformStatus", "OK", "TransformValid", "1", NULL};
    static const char *const missing[] = {"A", "b", "TransformStatus", "MISSING", NULL};
    const struct device_option options[] = {{"tool.probe", "ProbeToTracker"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    bytes.size = 0;
    append_transform(&bytes, "ProbeToTracker", 20, ok);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_at(&p, CHANNEL_PROBE, 20);
    bytes.size = 0;
    append_transform(&bytes, "ProbeToTracker", 0, missing);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_lost(&p, CHANNEL_PROBE);
    bytes.size = 0; // a matrix of zeros is no fault of such a message
    append_told(&bytes, "TRANSFORM", "ProbeToTracker", (const float[12]){0}, 48, missing);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_lost(&p, CHANNEL_PROBE);
    bytes.size = 0; // POSITION: its place, and the quaternion 0 0 0 1
    append_told(&bytes, "POSITION", "ProbeToTracker", (const uint8_t[28]){[24] = 0x3f, [25] = 0x80},
                28, missing);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_lost(&p, CHANNEL_PROBE);
    bytes.size = 0;
    append_transform(&bytes, "ProbeToTracker", 21, no_pairs);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_at(&p, CHANNEL_PROBE, 21);
    end(&p);
}

static void each_tool_of_a_tdata_has_its_own_state(void **state) {
    (void)state;
    static const char *const names[] = {"Probe", "Punch"};
    static const char *const told[] = {"ProbeStatus", "OUT_OF_VIEW", "PunchStatus", "OK", NULL};
    const struct device_option options[] = {
        {"tool.probe", "Probe"}, {"tool.punch", "Punch"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    bytes.size = 0;
    append_tdata(&bytes, 2, names, (const float[]){1, 2}, told);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_lost(&p, CHANNEL_PROBE);
    assert_at(&p, CHANNEL_PUNCH, 2);
    end(&p);
}

// PLUS cuts names after 20 bytes and has the whole ones among the metadata.
static void long_names_that_begin_alike_are_two_tools(void **state) {
    (void)state;
    static const char *const long_names[] = {"StylusTipToReferenceLeft",
                                             "StylusTipToReferenceRight"};
    static const char *const left[] = {"IGTL_DEVICE_NAME", "StylusTipToReferenceLeft", NULL};
    static const char *const right[] = {"IGTL_DEVICE_NAME", "StylusTipToReferenceRight", NULL};
    static const char *const both[] = {"StylusTipToReferenceLeftIndex",
                                       "0",
                                       "StylusTipToReferenceLeftStatus",
                                       "MISSING",
                                       "StylusTipToReferenceRightIndex",
                                       "1",
                                       "StylusTipToReferenceRightStatus",
                                       "OK",
                                       NULL};
    const struct device_option options[] = {
        {"tool.probe", long_names[1]}, {"tool.punch", long_names[0]}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    bytes.size = 0;
    append_transform(&bytes, "StylusTipToReference", 1, left);
    append_transform(&bytes, "StylusTipToReference", 2, right);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_at(&p, CHANNEL_PUNCH, 1);
    assert_at(&p, CHANNEL_PROBE, 2);
    bytes.size = 0;
    append_tdata(&bytes, 2, long_names, (const float[]){3, 4}, both);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_lost(&p, CHANNEL_PUNCH);
    assert_at(&p, CHANNEL_PROBE, 4);
    bytes.size = 0; // a server of version 1 cuts both alike
    append_transform(&bytes, "StylusTipToReference", 5, no_pairs);
    say(&p, &bytes);
    assert_int_equal(p.reading.count, 0);
    end(&p);
}

static void a_name_of_20_bytes_stands_for_the_first_long_one(void **state) {
    (void)state;
    static const char *const left[] = {"IGTL_DEVICE_NAME", "StylusTipToReferenceLeft", NULL};
    static const char *const right[] = {"IGTL_DEVICE_NAME", "StylusTipToReferenceRight", NULL};
    const struct device_option options[] = {{"tool.probe", "StylusTipToReference"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    for (int i = 0; i < 3; i++) {
        bytes.size = 0;
        append_transform(&bytes, "StylusTipToReference", 1, left);
        append_transform(&bytes, "StylusTipToReference", 2, right);
        assert_int_equal(say(&p, &bytes), RESULT_OK);
        assert_at(&p, CHANNEL_PROBE, 1);
    }
    end(&p);
}

static void names_may_be_filled_up_with_blanks(void **state) {
    (void)state;
    static const char *const padded[] = {"P                   "};
    const struct device_option options[] = {{"tool.probe", "P"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    bytes.size = 0;
    append_transform(&bytes, padded[0], 7, no_pairs);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_at(&p, CHANNEL_PROBE, 7);
    bytes.size = 0;
    append_tdata(&bytes, 1, padded, (const float[]){8}, no_pairs);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_at(&p, CHANNEL_PROBE, 8);
    end(&p);
}

static void metadata_whose_sizes_lie_are_refused(void **state) {
    (void)state;
    static const char *const ok[] = {"TransformStatus", "OK", NULL};
    const struct device_option options[] = {{"tool.probe", "P"}, {NULL, NULL}};
    enum { HEADER = 58, COUNT_AT = 12 + 48, KEY_AT = COUNT_AT + 2, VALUE_AT = KEY_AT + 4 };
    static const int at[] = {COUNT_AT, COUNT_AT + 1, KEY_AT, KEY_AT + 1, VALUE_AT, VALUE_AT + 3};
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        struct peer p;
        static struct bytes good, bad;
        begin(&p, options);
        good.size = bad.size = 0;
        append_transform(&good, "P", 1, ok);
        good.data[HEADER + at[i]] += 1 + (at[i] == KEY_AT + 1);
        append_message(&bad, 2, "TRANSFORM", "P", good.data + HEADER, good.size - HEADER);
        assert_int_equal(say(&p, &bad), RESULT_FORMAT);
        assert_int_equal(p.reading.malformed, 1);
        assert_int_equal(p.reading.count, 0);
        end(&p);
    }
}

// Polls while the server says something each 20 ms, until the driver complains.
static enum result complaint_about(struct peer *p, const struct bytes *bytes) {
    enum result result = RESULT_OK;
    for (int i = 0; i < 100 && result == RESULT_OK; i++) {
        result = say(p, bytes);
        assert_int_equal(p->reading.count, 0);
        pause_ms(10);
    }
    return result;
}

static void a_tracker_that_sends_other_tools_only_is_told_of(void **state) {
    (void)state;
    const struct device_option options[] = {{"tool.probe", "Q"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    bytes.size = 0;
    append_transform(&bytes, "P", 1, no_pairs);
    append_transform(&bytes, "R", 2, no_pairs);
    assert_int_equal(complaint_about(&p, &bytes), RESULT_TIMEOUT);
    assert_non_null(
        strstr(p.err.text, "the tracker sends P, R, and nothing that the config names"));
    bytes.size = 0;
    append_transform(&bytes, "Q", 3, no_pairs);
    assert_int_equal(say(&p, &bytes), RESULT_OK);
    assert_at(&p, CHANNEL_PROBE, 3);
    end(&p);
}

static void a_tracker_that_sends_no_poses_is_told_of(void **state) {
    (void)state;
    const struct device_option options[] = {{"tool.probe", "Q"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    bytes.size = 0;
    append_message(&bytes, 1, "IMAGE", "Camera", "pixels", 6);
    assert_int_equal(complaint_about(&p, &bytes), RESULT_TIMEOUT);
    assert_non_null(strstr(p.err.text, "the tracker sends IMAGE, and no pose"));
    end(&p);
}

// Ten poses a second are no silence, nor are six.
static void a_slow_tracker_is_not_silent_between_two_poses(void **state) {
    (void)state;
    const struct device_option options[] = {{"tool.probe", "P"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    begin(&p, options);
    for (int i = 0; i < 5; i++) {
        bytes.size = 0;
        append_transform(&bytes, "P", (float)i, no_pairs);
        assert_int_equal(say(&p, &bytes), RESULT_OK);
        assert_at(&p, CHANNEL_PROBE, i);
        pause_ms(50);
        assert_int_equal(poll_once(&p), RESULT_OK);
    }
    pause_ms(250);
    assert_int_equal(poll_once(&p), RESULT_TIMEOUT);
    end(&p);
}

static void append_stamped(struct bytes *out, const float matrix[12], uint64_t stamp) {
    size_t at = out->size;
    append_matrix(out, matrix);
    for (int i = 0; i < 8; i++)
        out->data[at + 34 + (size_t)i] = (uint8_t)(stamp >> (56 - 8 * i));
}

static void a_tool_that_only_turns_under_one_stamp_is_used(void **state) {
    (void)state;
    const struct device_option options[] = {{"tool.probe", "probe"}, {NULL, NULL}};
    struct peer p;
    static struct bytes bytes;
    float matrix[12];
    begin(&p, options);
    matrix_at(0, matrix);
    for (int i = 0; i < 4; i++) {
        float angle = 0.1F * (float)i;
        matrix[0] = matrix[4] = cosf(angle);
        matrix[1] = sinf(angle);
        matrix[3] = -matrix[1];
        bytes.size = 0;
        append_stamped(&bytes, matrix, 77ULL << 32);
        assert_int_equal(say(&p, &bytes), RESULT_OK);
        assert_int_equal(p.reading.count, 1);
        pause_ms(110);
    }
    end(&p);
}

static void a_tracker_may_send_metres(void **state) {
    (void)state;
    static const char *const units[] = {"mm", "m"};
    for (int i = 0; i < 2; i++) {
        const struct device_option options[] = {{"tool.probe", "P"},
                                                {"tip.probe", "1 0 0"},
                                                {"T_mockup_tracker", "10 0 0"},
                                                {"unit", units[i]},
                                                {NULL, NULL}};
        struct peer p;
        static struct bytes bytes;
        begin(&p, options);
        bytes.size = 0;
        append_transform(&bytes, "P", 0.25, no_pairs);
        assert_int_equal(say(&p, &bytes), RESULT_OK);
        assert_at(&p, CHANNEL_PROBE, i ? 261 : 11.25);
        end(&p);
    }
}

// ---- the log ------------------------------------------------------------------------------------

// What `act` logs.
static void logged_by(void (*act)(struct peer *p), struct peer *p, char *out, size_t size) {
    FILE *file = tmpfile();
    assert_non_null(file);
    int before = dup(2);
    dup2(fileno(file), 2);
    act(p);
    dup2(before, 2);
    close(before);
    rewind(file);
    out[fread(out, 1, size - 1, file)] = 0;
    fclose(file);
}

static int count_of(const char *text, const char *part) {
    int count = 0;
    for (; (text = strstr(text, part)); text++)
        count++;
    return count;
}

static void say_states(struct peer *p) {
    static struct bytes bytes;
    for (int i = 0; i < 40; i++) {
        uint8_t body[40] = {0, (uint8_t)(i % 10 ? 13 : 1)};
        snprintf((char *)body + 30, 10, "lamp %d", i);
        bytes.size = 0;
        append_message(&bytes, 1, "STATUS", "Tracker", body, sizeof body);
        say(p, &bytes);
    }
}

static void a_status_whose_text_changes_is_logged_once(void **state) {
    (void)state;
    const struct device_option options[] = {{"tool.probe", "P"}, {NULL, NULL}};
    struct peer p;
    char text[8192];
    begin(&p, options);
    logged_by(say_states, &p, text, sizeof text);
    assert_int_equal(count_of(text, "says status 13"), 1);
    end(&p);
}

static void say_near_poses(struct peer *p) {
    static struct bytes bytes;
    for (int i = 0; i < 150; i++) {
        bytes.size = 0;
        append_transform(&bytes, "P", 0.3F + 0.001F * (float)i, no_pairs);
        say(p, &bytes);
    }
}

static void a_tracker_that_seems_to_send_metres_is_told_of(void **state) {
    (void)state;
    static const char *const units[] = {"mm", "m"};
    for (int i = 0; i < 2; i++) {
        const struct device_option options[] = {
            {"tool.probe", "P"}, {"unit", units[i]}, {NULL, NULL}};
        struct peer p;
        char text[8192];
        begin(&p, options);
        logged_by(say_near_poses, &p, text, sizeof text);
        assert_int_equal(count_of(text, "does it send metres (unit = m)?"), 1 - i);
        end(&p);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_client_speaks_version_2_first),
        cmocka_unit_test(a_tool_that_is_said_to_be_missing_is_lost),
        cmocka_unit_test(each_tool_of_a_tdata_has_its_own_state),
        cmocka_unit_test(long_names_that_begin_alike_are_two_tools),
        cmocka_unit_test(a_name_of_20_bytes_stands_for_the_first_long_one),
        cmocka_unit_test(names_may_be_filled_up_with_blanks),
        cmocka_unit_test(metadata_whose_sizes_lie_are_refused),
        cmocka_unit_test(a_tracker_that_sends_other_tools_only_is_told_of),
        cmocka_unit_test(a_tracker_that_sends_no_poses_is_told_of),
        cmocka_unit_test(a_slow_tracker_is_not_silent_between_two_poses),
        cmocka_unit_test(a_tool_that_only_turns_under_one_stamp_is_used),
        cmocka_unit_test(a_tracker_may_send_metres),
        cmocka_unit_test(a_status_whose_text_changes_is_logged_once),
        cmocka_unit_test(a_tracker_that_seems_to_send_metres_is_told_of),
    };
    return cmocka_run_group_tests_name("tracker_peer", tests, NULL, NULL);
}
