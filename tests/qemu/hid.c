// Where the kernel has /dev/uhid (see machine): plugs in an emulated handle, reads it as a station
// does, pulls the plug and puts it back.

#include "base/clock.h"
#include "base/log.h"
#include "drivers/hid_descriptor.h"
#include "drivers/hid_find.h"
#include "handle.h"
#include "handle_player.h"
#include "samples/runner.h"
#include "test.h"

#include <hidapi.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static void sleep_ms(int ms) {
    struct timespec wait = {ms / 1000, ms % 1000 * NS_PER_MS};
    nanosleep(&wait, NULL);
}

static int plugged_into(const char *port, const char *serial) {
    int handle;
    struct error err;
    if (handle_plug(serial, port, &handle, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return handle;
}

static int plugged(const char *serial) {
    return plugged_into("", serial);
}

static void send(int handle, double opening, uint8_t buttons) {
    uint8_t report[HANDLE_REPORT_BYTES];
    struct error err;
    handle_report(opening, buttons, report);
    if (handle_send(handle, report, sizeof report, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static struct runner *reading(const char *serial, const char *on_change) {
    struct device_option options[] = {{"driver", "hid"},
                                      {"vid", "1209"},
                                      {"pid", "0001"},
                                      {"serial", serial},
                                      {"usage", "1 4"},
                                      {"on_change", on_change},
                                      {"punch.opening", "1:0 16 0 10000"},
                                      {"punch.buttons", "1:16 8"}};
    struct device_config config = {"punch", options, sizeof options / sizeof *options};
    struct runner *runner = NULL;
    struct error err;
    if (runner_create(&config, 1, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return runner;
}

static struct sample newest(struct runner *runner) {
    struct frame frame = {0};
    runner_collect(runner, clock_now_ns(), &frame);
    assert_int_equal(1, frame.count);
    assert_int_equal(CHANNEL_PUNCH, frame.samples[0].channel);
    assert_int_equal(SAMPLE_HANDLE, frame.samples[0].kind);
    return frame.samples[0];
}

static struct device_status status(struct runner *runner) {
    struct device_status status;
    runner_status(runner, 0, &status);
    return status;
}

// At most 20 s: software emulation is slow.
#define assert_soon(condition)                                                                     \
    do {                                                                                           \
        bool is_so = false;                                                                        \
        for (int waits = 0; waits < 2000 && !(is_so = (condition)); waits++)                       \
            sleep_ms(10);                                                                          \
        if (!is_so)                                                                                \
            fail_msg("not so after a while: %s", #condition);                                      \
    } while (0)

static bool says(struct runner *runner, double opening, uint32_t buttons) {
    struct sample s = newest(runner);
    return s.validity == VALIDITY_OK && fabs(s.handle.opening - opening) < 1e-9 &&
           s.handle.buttons == buttons;
}

// The kernel drops reports while it is still setting the device up: ask again until it is so.
static bool tells(int handle, struct runner *runner, double opening, uint8_t buttons) {
    send(handle, opening, buttons);
    return says(runner, opening, buttons);
}

static void a_handle_is_read_while_it_is_plugged_in(void **state) {
    (void)state;
    int handle = plugged("A1");
    struct runner *runner = reading("A1", "yes");
    assert_soon(status(runner).connected);
    for (int i = 0; i <= 100; i++) {
        assert_soon(tells(handle, runner, i / 100.0, (uint8_t)(i * 5)));
    }
    assert_int_equal(0, status(runner).malformed);
    runner_destroy(&runner);
    handle_unplug(handle);
}

static void values_hold_while_a_device_that_reports_changes_says_nothing(void **state) {
    (void)state;
    int handle = plugged("A2");
    struct runner *runner = reading("A2", "yes");
    assert_soon(status(runner).connected);
    assert_soon(tells(handle, runner, 0.25, 1));
    uint64_t readings = status(runner).readings;
    assert_soon(status(runner).readings > readings + 10);
    assert_soon(says(runner, 0.25, 1));
    runner_destroy(&runner);
    handle_unplug(handle);
}

static void silence_of_a_device_that_reports_all_the_time_is_a_loss(void **state) {
    (void)state;
    int handle = plugged("A3");
    struct runner *runner = reading("A3", "no");
    assert_soon(status(runner).connected);
    assert_soon(tells(handle, runner, 0.25, 1));
    assert_soon(newest(runner).validity == VALIDITY_LOST);
    assert_true(status(runner).connected);
    uint64_t readings = status(runner).readings;
    send(handle, 0.5, 0);
    assert_soon(status(runner).readings == readings + 1);
    runner_destroy(&runner);
    handle_unplug(handle);
}

static void a_handle_that_is_plugged_in_again_is_read_again(void **state) {
    (void)state;
    struct runner *runner = reading("A4", "yes");
    assert_soon(status(runner).problem[0]);
    assert_false(status(runner).connected);
    for (int i = 0; i < 3; i++) {
        int handle = plugged("A4");
        assert_soon(status(runner).connected);
        assert_int_equal(i, status(runner).reopenings);
        sleep_ms(
            100); // it has said nothing yet, and what it said before the plug was pulled is old
        assert_int_equal(VALIDITY_LOST, newest(runner).validity);
        assert_soon(tells(handle, runner, 0.1 * i, (uint8_t)i));
        handle_unplug(handle);
        assert_soon(!status(runner).connected);
        assert_soon(newest(runner).validity == VALIDITY_LOST);
    }
    runner_destroy(&runner);
}

static void the_serial_number_tells_two_handles_apart(void **state) {
    (void)state;
    struct hid_plugged all[8];
    int left = plugged("left"), right = plugged("right");
    assert_soon(hid_list(all, 8) == 2);
    struct runner *runner = reading("right", "yes"), *any = reading("", "yes");
    assert_soon(status(runner).connected);
    assert_soon(strstr(status(any).problem, "several"));
    send(left, 0.9, 1);
    assert_soon(tells(right, runner, 0.2, 2));
    handle_unplug(left);
    assert_soon(status(any).connected);
    assert_soon(tells(right, any, 0.3, 3));
    assert_soon(says(runner, 0.3, 3));
    runner_destroy(&any);
    runner_destroy(&runner);
    handle_unplug(right);
}

static void the_port_tells_two_handles_of_one_serial_number_apart(void **state) {
    (void)state;
    struct hid_plugged all[8];
    int left = plugged_into("usb-1/input0", "A6"), right = plugged_into("usb-2/input0", "A6");
    assert_soon(hid_list(all, 8) == 2);
    assert_string_not_equal(all[0].identity.port, all[1].identity.port);
    struct hid_device_ *device = NULL;
    struct hid_identity wanted = {.vid = HANDLE_VID, .pid = HANDLE_PID, .serial = "A6"};
    assert_int_equal(RESULT_INVALID, hid_find(&wanted, &device, NULL));
    strcpy(wanted.port, "usb-2/input0");
    assert_int_equal(RESULT_OK, hid_find(&wanted, &device, NULL));
    hid_close(device);
    strcpy(wanted.port, "usb-3/input0");
    assert_int_equal(RESULT_MISSING, hid_find(&wanted, &device, NULL));
    handle_unplug(left);
    handle_unplug(right);
}

static void half_a_report_changes_nothing_and_the_next_one_is_read(void **state) {
    (void)state;
    int handle = plugged("A5");
    struct runner *runner = reading("A5", "yes");
    assert_soon(status(runner).connected);
    assert_soon(tells(handle, runner, 0.5, 7));
    assert_int_equal(RESULT_OK, handle_send(handle, (uint8_t[]){1, 0}, 2, NULL));
    uint64_t readings = status(runner).readings; // newer kernels do not even pass it on
    assert_soon(status(runner).readings > readings + 5);
    assert_soon(says(runner, 0.5, 7));
    assert_soon(tells(handle, runner, 0.75, 0));
    runner_destroy(&runner);
    handle_unplug(handle);
}

static void a_plugged_device_is_listed_with_a_layout(void **state) {
    (void)state;
    static struct hid_descriptor descriptor;
    static uint8_t bytes[HID_DESCRIPTOR_BYTES_MAX];
    struct hid_plugged all[8];
    char text[HID_PROPOSAL_BYTES_MAX];
    size_t size;
    int handle = plugged("A6");
    assert_soon(hid_list(all, 8) == 1);
    assert_int_equal(HANDLE_VID, all[0].identity.vid);
    assert_int_equal(HANDLE_PID, all[0].identity.pid);
    assert_int_equal(1, all[0].identity.usage_page);
    assert_int_equal(4, all[0].identity.usage);
    assert_string_equal("A6", all[0].identity.serial);
    assert_string_equal("Arthron punch", all[0].product);
    assert_int_equal(RESULT_OK, hid_read_descriptor(all[0].path, bytes, &size, NULL));
    assert_int_equal(RESULT_OK, hid_descriptor_read(bytes, size, &descriptor, NULL));
    hid_propose(&descriptor, CHANNEL_PUNCH, text);
    assert_string_equal("usage = 0x0001 0x0004\n"
                        "punch.opening = 1:0 16 0 10000\n"
                        "punch.buttons = 1:16 8\n",
                        text);
    handle_unplug(handle);
    assert_soon(hid_list(all, 8) == 0);
}

static void the_mockups_handle_plays_its_file_and_its_faults(void **state) {
    (void)state;
    double t_seconds[] = {0, 1, 1.01, 2};
    struct recording_state states[] = {
        {.opening = 0.3}, {.opening = 0.3}, {.opening = 0.02}, {.opening = 0.02}};
    struct player player = {
        .recording = {.row_count = 4,
                      .t_seconds = t_seconds,
                      .tool_count = 1,
                      .tools = {{.channel = CHANNEL_PUNCH, .has_opening = true, .states = states}}},
        .start_ns = clock_now_ns()};
    static struct faults faults = {
        1, {{"", FAULT_HID, FAULT_UNPLUG, .at_s = 5, .for_s = 1, .every = 1}}};
    atomic_bool stop = false;
    struct handle_player hid = {.player = &player,
                                .faults = &faults,
                                .stop = &stop,
                                .serial = "desk",
                                .rate_hz = 125,
                                .handle = -1};
    pthread_t thread;
    struct runner *runner = reading("desk", "no");
    assert_int_equal(0, pthread_create(&thread, NULL, handle_player_run, &hid));
    assert_soon(says(runner, 0.3, 0));
    assert_soon(says(runner, 0.02, 1));
    assert_soon(!status(runner).connected);
    assert_soon(status(runner).reopenings == 1);
    assert_soon(says(runner, 0.3, 0));
    atomic_store(&stop, true);
    pthread_join(thread, NULL);
    assert_soon(!status(runner).connected);
    runner_destroy(&runner);
}

int main(void) {
    setvbuf(stdout, NULL, _IOLBF, 0);
    log_set_level(LOG_ERROR);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_handle_is_read_while_it_is_plugged_in),
        cmocka_unit_test(values_hold_while_a_device_that_reports_changes_says_nothing),
        cmocka_unit_test(silence_of_a_device_that_reports_all_the_time_is_a_loss),
        cmocka_unit_test(a_handle_that_is_plugged_in_again_is_read_again),
        cmocka_unit_test(the_serial_number_tells_two_handles_apart),
        cmocka_unit_test(the_port_tells_two_handles_of_one_serial_number_apart),
        cmocka_unit_test(half_a_report_changes_nothing_and_the_next_one_is_read),
        cmocka_unit_test(a_plugged_device_is_listed_with_a_layout),
        cmocka_unit_test(the_mockups_handle_plays_its_file_and_its_faults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
