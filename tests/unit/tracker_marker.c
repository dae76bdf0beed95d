// STRING messages, as OpenIGTLink's own class makes them, as markers.
#include "drivers/tracker_marker.h"

#include "base/clock.h"
#include "drivers/socket.h"
#include "library_sensor.h"
#include "openigtlink_stream.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static struct igtl_message message_of(const char *device, double utc_s, const char *text) {
    static struct bytes bytes;
    bytes.size = library_string(device, utc_s, text, bytes.data, sizeof bytes.data);
    assert_true(bytes.size > 0);
    struct report r = report_of(&bytes);
    assert_int_equal(r.count, 1);
    assert_int_equal(r.events[0], IGTL_STRING);
    return r.last;
}

static enum result read_key(const char *key, const char *value, struct tracker_markers *out) {
    const struct device_option option = {key, value};
    const struct device_config config = {"camera", &option, 1};
    struct error err;
    return tracker_markers_configure(&config, out, &err);
}

static void a_string_of_the_named_device_is_a_marker_with_its_stamp(void **state) {
    (void)state;
    struct tracker_markers markers;
    struct device_reading reading = {0};
    assert_int_equal(read_key("marker.trial", "string Stimulus", &markers), RESULT_OK);
    tracker_markers_begin(&markers);
    const int64_t clock_ns = 5 * NS_PER_S; // ours, when theirs is 1000 s
    static const int delays_ms[] = {2, 30, 2, 60};
    static const char *const texts[] = {"go", "17", "-2.5", "18 apples"};
    static const double values[] = {1, 17, -2.5, 1};
    for (int i = 0; i < 4; i++) {
        struct igtl_message message = message_of("Stimulus", 1000 + i, texts[i]);
        assert_string_equal(message.text, texts[i]);
        assert_true(tracker_markers_take(&markers, true, &message,
                                         clock_ns + i * NS_PER_S + delays_ms[i] * NS_PER_MS,
                                         &reading));
    }
    assert_int_equal(reading.marker_count, 4);
    for (int i = 0; i < 4; i++) { // the shortest way stays in the time
        assert_string_equal(reading.markers[i].name, "trial");
        assert_true(reading.markers[i].value == values[i]);
        assert_near((double)(reading.markers[i].time_ns - clock_ns - i * NS_PER_S) / NS_PER_MS, 2,
                    1e-3);
    }
    struct igtl_message other = message_of("Other", 1005, "go");
    assert_false(tracker_markers_take(&markers, true, &other, clock_ns, &reading));
    assert_int_equal(reading.marker_count, 4);
}

static void without_stamps_the_time_is_that_of_the_arrival(void **state) {
    (void)state;
    struct tracker_markers markers;
    struct device_reading reading = {0};
    assert_int_equal(read_key("marker.trial", "string Stimulus", &markers), RESULT_OK);
    struct igtl_message message = message_of("Stimulus", 1000, "go");
    for (int i = 0; i < 2; i++) {
        assert_true(tracker_markers_take(&markers, false, &message, 1000 + i, &reading));
        assert_int_equal(reading.markers[i].time_ns, 1000 + i);
    }
}

// A server that gives no poses: only the test's own end of the socket sends.
static void the_driver_reads_markers_of_a_server_without_tools(void **state) {
    (void)state;
    char address[] = "127.0.0.1:0", full[32];
    int listener;
    uint16_t port;
    struct error err = {""};
    assert_int_equal(socket_listen(address, &listener, &port, &err), RESULT_OK);
    snprintf(full, sizeof full, "127.0.0.1:%u", port);
    const struct device_option options[] = {
        {"address", full}, {"request", "none"}, {"marker.trial", "string Stimulus"}};
    const struct device_config config = {"camera", options, 3};
    const struct device_driver *driver = device_driver("tracker");
    struct device_outputs outputs = {0};
    void *device;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(outputs.count, 0);
    int server = accept(listener, NULL, NULL);
    uint8_t bytes[200];
    size_t size = library_string("Stimulus", 1000, "3", bytes, sizeof bytes);
    assert_int_equal(send(server, bytes, size, 0), size);
    struct device_reading reading = {0};
    for (int i = 0; i < 50 && !reading.marker_count; i++)
        driver->poll(device, &reading, &err);
    assert_int_equal(reading.marker_count, 1);
    assert_true(reading.markers[0].value == 3 && reading.heard);
    driver->close(device);
    driver->destroy(device);
    close(server);
    close(listener);
}

static void a_string_that_is_cut_short_is_refused(void **state) {
    (void)state;
    static const uint8_t bodies[][8] = {{0, 3, 0, 5, 'a', 'b', 'c', 'd'}, {0, 3, 0}};
    static const size_t sizes[] = {8, 3};
    for (int i = 0; i < 2; i++) {
        static struct bytes bytes;
        bytes.size = 0;
        append_message(&bytes, 1, "STRING", "Stimulus", bodies[i], sizes[i]);
        assert_int_equal(report_of(&bytes).refused, 1);
    }
}

static void keys_that_say_nothing_are_refused(void **state) {
    (void)state;
    struct tracker_markers markers;
    assert_int_equal(read_key("marker.a", "Stimulus", &markers), RESULT_INVALID);
    assert_int_equal(read_key("marker.a", "string ", &markers), RESULT_INVALID);
    assert_int_equal(read_key("marker.a", "string a name of 21 bytes...", &markers),
                     RESULT_INVALID);
    assert_int_equal(read_key("marker.a b", "string x", &markers), RESULT_INVALID);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_string_of_the_named_device_is_a_marker_with_its_stamp),
        cmocka_unit_test(without_stamps_the_time_is_that_of_the_arrival),
        cmocka_unit_test(the_driver_reads_markers_of_a_server_without_tools),
        cmocka_unit_test(a_string_that_is_cut_short_is_refused),
        cmocka_unit_test(keys_that_say_nothing_are_refused),
    };
    return cmocka_run_group_tests_name("tracker_marker", tests, NULL, NULL);
}
