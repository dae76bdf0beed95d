// Several slaves of the mock-up on one line, and all types of their registers.

#include "base/clock.h"
#include "in_folder.h"
#include "mockup_program.h"
#include "samples/runner.h"
#include "test.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { SLAVES = 3, OPTIONS_MAX = 16 };

// Never moves; encoder: (-77.3125 + 180) / 360 of 2^17 steps is 37387.7.
static const char *motion(void) {
    const char *path = in_folder("still.csv");
    FILE *file = fopen(path, "w");
    fputs("t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm\n", file);
    for (int i = 0; i < 100; i++)
        fprintf(file, "%.2f,-77.3125,1.0001,-2.0002,3.25,-4,0.5\n", i * 0.01);
    fclose(file);
    return path;
}

static struct runner *station_of(const char *line, const char *kind, const char *first,
                                 const char *order) {
    static const char *const numbers[] = {"5", "6", "7"};
    const struct device_option options[SLAVES][OPTIONS_MAX] = {
        {{"driver", "modbus"},
         {kind, line},
         {"slave", numbers[0]},
         {"order", order},
         {"first_register", first},
         {"flexion", *first == '0' ? "12 f32" : "40013 f32"},
         {"varus", *first == '0' ? "26 0.0001 i32" : "40027 0.0001 i32"},
         {"internal", *first == '0' ? "3 0.01" : "40004 0.01"}},
        {{"driver", "modbus"},
         {kind, line},
         {"slave", numbers[1]},
         {"order", order},
         {"registers", "input"},
         {"probe.opening", "10 0.1 u16"}},
        {{"driver", "modbus"},
         {kind, line},
         {"slave", numbers[2]},
         {"order", order},
         {"punch.opening", "36 1e-5 u17"}},
    };
    struct device_config configs[SLAVES];
    struct runner *runner;
    struct error err;
    for (int i = 0; i < SLAVES; i++) {
        configs[i] = (struct device_config){"", options[i], 0};
        snprintf(configs[i].name, sizeof configs[i].name, "%s", numbers[i]);
        while (options[i][configs[i].option_count].key)
            configs[i].option_count++;
    }
    if (runner_create(configs, SLAVES, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return runner;
}

static bool all_have_values(struct runner *runner, struct frame *out) {
    *out = (struct frame){.number = 1};
    runner_collect(runner, clock_now_ns(), out);
    int good = 0;
    for (int i = 0; i < out->count; i++)
        good += out->samples[i].validity == VALIDITY_OK;
    return good == SLAVES;
}

static void expect_values_of_all(struct runner *runner) {
    struct frame frame;
    int64_t end_ns = clock_now_ns() + 20 * NS_PER_S;
    while (!all_have_values(runner, &frame) && clock_now_ns() < end_ns)
        usleep(5000);
    assert_true(all_have_values(runner, &frame));
    for (int i = 0; i < frame.count; i++) {
        const struct sample *s = &frame.samples[i];
        if (s->channel == CHANNEL_JOINT) {
            assert_near(s->joint.flexion_deg, -77.3125, 0);
            assert_near(s->joint.varus_deg, 1.0001, 1e-9);
            assert_near(s->joint.internal_deg, -2, 1e-9);
        } else if (s->channel == CHANNEL_PROBE) {
            assert_near(s->handle.opening, 0.6, 1e-9); // slave 6 says its number
        } else {
            assert_near(s->handle.opening, 0.37387, 1e-9);
        }
    }
    runner_destroy(&runner);
}

static void three_slaves_of_a_line_speak_all_types_in_each_order(void **state) {
    (void)state;
    static const char *const orders[] = {"ABCD", "CDAB", "BADC", "DCBA"};
    for (int i = 0; i < 4; i++) {
        const char *path = in_folder("line");
        struct mockup m =
            start(2, "--motion", motion(), "--modbus-rtu", path, "--modbus-tcp", "127.0.0.1:0",
                  "--slave", "5", "--slaves", "3", "--order", orders[i]);
        expect_values_of_all(station_of(path, "serial", "0", orders[i]));
        if (i == 0)
            expect_values_of_all(station_of(m.modbus_tcp, "address", "40001", orders[i]));
        assert_int_equal(0, ended(&m, SIGTERM));
    }
}

// A line with other settings hears nothing that it understands.
static void only_the_lines_own_settings_are_heard(void **state) {
    (void)state;
    static const struct {
        const char *baud, *stop_bits;
        bool heard;
    } rows[] = {{"19200", "2", true}, {"9600", "2", false}, {"19200", "1", false}};
    const char *path = in_folder("line");
    struct mockup m = start(1, "--motion", motion(), "--modbus-rtu", path, "--line", "19200 2");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct device_option options[] = {{"serial", path},
                                                {"baud", rows[i].baud},
                                                {"stop_bits", rows[i].stop_bits},
                                                {"flexion", "1 0.01"},
                                                {"timeout_ms", "100"}};
        struct device_config config = {"encoders", options, sizeof options / sizeof *options};
        const struct device_driver *driver = device_driver("modbus");
        struct device_outputs outputs = {0};
        struct device_reading reading = {0};
        struct error err;
        void *device;
        assert_int_equal(RESULT_OK, driver->create(&config, &device, &outputs, &err));
        assert_int_equal(RESULT_OK, driver->open(device, &err));
        for (int k = 0; k < (rows[i].heard ? 50 : 1) && !reading.count; k++)
            driver->poll(device, &reading, &err);
        assert_int_equal(reading.count, rows[i].heard);
        driver->close(device);
        driver->destroy(device);
    }
    assert_int_equal(0, ended(&m, SIGTERM));
}

static void options_that_name_no_slave_are_refused(void **state) {
    (void)state;
    static const char *const wrong[][2] = {
        {"--slaves", "0"},   {"--slaves", "248"},   {"--order", "ABDC"},     {"--line", "19200"},
        {"--line", "100 1"}, {"--line", "19200 3"}, {"--line", "19200 1 1"}, {"--slave", "248"}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct mockup m =
            start(0, "--motion", motion(), "--modbus-tcp", "127.0.0.1:0", wrong[i][0], wrong[i][1]);
        assert_int_equal(2, ended(&m, 0));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_slaves_of_a_line_speak_all_types_in_each_order),
        cmocka_unit_test(only_the_lines_own_settings_are_heard),
        cmocka_unit_test(options_that_name_no_slave_are_refused),
    };
    return cmocka_run_group_tests_name("mockup_slaves", tests, make_folder, remove_folder);
}
