// The tracker driver against servers of the OpenIGTLink library's own classes: those that send only
// when they are asked, and those that do not care.
#include "base/clock.h"
#include "drivers/device.h"
#include "igtl/request.h"
#include "library_server.h"
#include "test.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>

static const struct device_driver *driver;

static void *opened(int port, const char *request) {
    char address[64];
    snprintf(address, sizeof address, "127.0.0.1:%d", port);
    const struct device_option options[] = {{"address", address},  {"tool.probe", "pointer"},
                                            {"request_ms", "20"},  {"coordinates", "Patient"},
                                            {"device", "Tracker"}, {"request", request}};
    struct device_config config = {"camera", options, request ? 6 : 5};
    struct device_outputs outputs = {0};
    struct error err;
    void *device = NULL;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return device;
}

// Poses that come until there are 20, a stamp stands still, or a while is over.
static int readings_of(void *device, double patience_s, int *told, struct error *err) {
    int64_t end_ns = clock_now_ns() + (int64_t)(patience_s * NS_PER_S);
    int readings = 0;
    bool still = false;
    while (readings < 20 && !still && clock_now_ns() < end_ns) {
        struct device_reading reading = {0};
        struct error why = {{0}};
        enum result result = driver->poll(device, &reading, &why);
        still = result == RESULT_FORMAT && strstr(why.text, "its time stamps have stood still for");
        bool late = result == RESULT_FORMAT && strstr(why.text, "late"); // the machine is busy
        bool unknown = result == RESULT_FORMAT && strstr(why.text, "OpenIGTLink version 9");
        assert_true(result == RESULT_OK || result == RESULT_TIMEOUT || still || late || unknown);
        *told += unknown;
        if (result == RESULT_TIMEOUT || still || unknown)
            *err = why;
        readings += reading.count;
        for (int i = 0; i < reading.count; i++)
            assert_near(reading.samples[i].T_mockup_body.translation.x, 12.5, 0.51);
    }
    return readings;
}

struct outcome {
    int readings, told; // told: of an unknown version
    struct library_server_record record;
    struct error err;
};

static struct outcome outcome_of(enum library_server_kind kind, const char *request,
                                 double patience_s) {
    struct outcome outcome = {0};
    int port;
    struct library_server *server = library_server_start(kind, &port);
    assert_non_null(server);
    void *device = opened(port, request);
    outcome.readings = readings_of(device, patience_s, &outcome.told, &outcome.err);
    driver->close(device);
    driver->destroy(device);
    outcome.record = library_server_told(server);
    library_server_stop(server);
    return outcome;
}

static void a_server_that_waits_to_be_asked_is_asked(void **state) {
    (void)state;
    static const struct {
        enum library_server_kind kind;
        const char *request;
    } rows[] = {{SENDS_TDATA, NULL},
                {SENDS_TDATA, "TDATA"},
                {SENDS_QTDATA, "auto"},
                {SENDS_QTDATA, "QTDATA"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct outcome o = outcome_of(rows[i].kind, rows[i].request, 30);
        assert_int_equal(o.readings, 20);
        assert_true(o.record.requests >= 1);
        assert_int_equal(o.record.interval_ms, 20);
        assert_string_equal(o.record.coordinates, "Patient");
    }
}

static void a_server_that_sends_by_itself_is_left_in_peace(void **state) {
    (void)state;
    struct outcome o = outcome_of(SENDS_BY_ITSELF, NULL, 30);
    assert_int_equal(o.readings, 20);
    o = outcome_of(SENDS_BY_ITSELF, "TDATA", 30); // asked, and sends what it has all the same
    assert_int_equal(o.readings, 20);
}

// As of a sender that never stamps its messages.
static void stamps_that_stand_still_while_the_tool_moves_are_not_used(void **state) {
    (void)state;
    assert_int_equal(outcome_of(SENDS_ONE_STAMP, NULL, 30).readings, 20);
}

static void a_pose_that_is_repeated_with_its_stamp_is_used_once(void **state) {
    (void)state;
    struct outcome o = outcome_of(REPEATS_ITSELF, NULL, 30);
    assert_int_equal(o.readings, 1);
    assert_non_null(strstr(o.err.text, "stood still"));
}

static void nothing_is_asked_where_the_config_says_none(void **state) {
    (void)state;
    struct outcome o = outcome_of(SENDS_TDATA, "none", 1.2);
    assert_int_equal(o.readings, 0);
    assert_int_equal(o.record.requests, 0);
}

static void a_server_that_refuses_is_said_to(void **state) {
    (void)state;
    struct outcome o = outcome_of(REFUSES, "TDATA", 1);
    assert_int_equal(o.readings, 0);
    assert_non_null(
        strstr(o.err.text, "the tracker sends nothing; it refused a request for TDATA"));
}

static void a_server_that_gives_a_pose_for_each_get_is_asked_again_and_again(void **state) {
    (void)state;
    static const char *const requests[] = {"auto", "TRANSFORM"};
    for (int i = 0; i < 2; i++) {
        struct outcome o = outcome_of(ANSWERS_GET, requests[i], 30);
        assert_int_equal(o.readings, 20);
        assert_in_range(o.record.gets, 24, 36);
        assert_int_equal(o.record.requests, i ? 0 : 2); // it was found, and no other way is tried
    }
}

static void a_server_that_sends_nothing_is_asked_how_it_is(void **state) {
    (void)state;
    struct outcome o = outcome_of(SENDS_STATUS, "auto", 1.2);
    assert_int_equal(o.readings, 0);
    assert_int_equal(o.record.statuses, 1);
    assert_non_null(strstr(o.err.text, "the tracker sends nothing; it says status 13: Warming up: "
                                       "the lamps are cold"));
}

static unsigned number_at(const uint8_t *bytes, int count) {
    unsigned value = 0;
    for (int i = 0; i < count; i++)
        value = value << 8 | bytes[i];
    return value;
}

// A server that was heard in version 2 or 3 knows that version's header, in which the content lies
// between an extended header of 12 bytes and the metadata, here none.
static void requests_go_out_in_the_version_in_which_the_server_spoke(void **state) {
    (void)state;
    enum { HEADER = 58, CONTENT = 36, RESOLUTION = 20 };
    for (unsigned version = 1; version <= 3; version++) {
        struct igtl_request request = {.kind = IGTL_REQUEST_TDATA, .interval_ms = RESOLUTION};
        uint8_t bytes[IGTL_REQUEST_BYTES_MAX];
        unsigned extended = version == 1 ? 0 : 12, metadata = version == 1 ? 0 : 2;
        igtl_request_begin(&request, 0);
        assert_int_equal(igtl_request_next(&request, 0, bytes), HEADER + HEADER + CONTENT);
        assert_string_equal((const char *)bytes + 2, "GET_STATUS");
        assert_int_equal(number_at(bytes + HEADER, 2), 1); // nobody spoke yet
        igtl_request_heard(&request, (int)version);
        igtl_request_heard(&request, 9);
        size_t size = igtl_request_next(&request, 10 * NS_PER_S, bytes);
        assert_int_equal(size, HEADER + extended + CONTENT + metadata);
        assert_int_equal(number_at(bytes, 2), version);
        assert_string_equal((const char *)bytes + 2, "STT_TDATA");
        assert_int_equal(number_at(bytes + 42, 4), 0);
        assert_int_equal(number_at(bytes + 46, 4), size - HEADER);
        assert_int_equal(number_at(bytes + HEADER + extended, 4), RESOLUTION);
        if (version > 1) {
            assert_int_equal(number_at(bytes + HEADER, 2), extended);
            assert_int_equal(number_at(bytes + HEADER + 2, 2), metadata);
            assert_int_equal(number_at(bytes + HEADER + 4, 4), 0);
            assert_int_equal(number_at(bytes + size - 2, 2), 0);
        }
    }
}

static void an_unknown_version_is_told_once_with_its_number(void **state) {
    (void)state;
    struct outcome o = outcome_of(SENDS_VERSION_9, "none", 0.5);
    assert_int_equal(o.readings, 0);
    assert_int_equal(o.told, 1);
    assert_non_null(strstr(o.err.text, "version 9, of which only 1 to 3 are known"));
}

static void of_two_devices_the_one_that_is_named_is_read(void **state) {
    (void)state;
    struct outcome o = outcome_of(HAS_TWO_DEVICES, "TDATA", 30);
    assert_int_equal(o.readings, 20);
    assert_string_equal(o.record.device, "Tracker");
}

int main(void) {
    signal(SIGPIPE, SIG_IGN); // the library sends to a client that left
    driver = device_driver("tracker");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_server_that_waits_to_be_asked_is_asked),
        cmocka_unit_test(a_server_that_sends_by_itself_is_left_in_peace),
        cmocka_unit_test(stamps_that_stand_still_while_the_tool_moves_are_not_used),
        cmocka_unit_test(a_pose_that_is_repeated_with_its_stamp_is_used_once),
        cmocka_unit_test(nothing_is_asked_where_the_config_says_none),
        cmocka_unit_test(a_server_that_refuses_is_said_to),
        cmocka_unit_test(a_server_that_gives_a_pose_for_each_get_is_asked_again_and_again),
        cmocka_unit_test(a_server_that_sends_nothing_is_asked_how_it_is),
        cmocka_unit_test(requests_go_out_in_the_version_in_which_the_server_spoke),
        cmocka_unit_test(an_unknown_version_is_told_once_with_its_number),
        cmocka_unit_test(of_two_devices_the_one_that_is_named_is_read),
    };
    return cmocka_run_group_tests_name("tracker_request", tests, NULL, NULL);
}
