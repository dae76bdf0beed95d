// The force of a file, through the mock-up program and the station's devices: a gauge on a serial
// line, as one register and as a vector of floats, and an OpenIGTLink SENSOR.

#include "base/clock.h"
#include "in_folder.h"
#include "mockup_program.h"
#include "samples/runner.h"
#include "test.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const double newtons_per_s = 4, update_hz = 200;

// The pose tells the time: the probe is at x = 40 u, and pressed with 8 u - 1 newtons.
static double force_of(double x_mm) {
    return x_mm / 5 - 1;
}

static void write_motion(void) {
    FILE *file = fopen(in_folder("motion.csv"), "w");
    fputs("t_seconds,probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,"
          "probe_valid,probe_force_n\n",
          file);
    for (int i = 0; i < 200; i++) {
        double u = i < 100 ? i / 100.0 : (200 - i) / 100.0;
        fprintf(file, "%.3f,%.9f,0,0,1,0,0,0,1,%.9f\n", i * 0.02, 40 * u, force_of(40 * u));
    }
    fclose(file);
}

static struct runner *station(const struct device_option *const options[], const int counts[],
                              int devices) {
    struct device_config configs[4];
    struct runner *runner = NULL;
    struct error err;
    for (int i = 0; i < devices; i++) {
        configs[i] = (struct device_config){.options = options[i], .option_count = counts[i]};
        snprintf(configs[i].name, DEVICE_NAME_MAX, "device %d", i);
    }
    if (runner_create(configs, devices, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return runner;
}

static struct frame newest(struct runner *runner) {
    struct frame frame = {.number = 1};
    runner_newest(runner, clock_now_ns(), &frame);
    assert_true(frame_is_valid(&frame));
    return frame;
}

static const struct sample *of(const struct frame *frame, enum channel channel,
                               enum sample_kind kind) {
    for (int i = 0; i < frame->count; i++)
        if (frame->samples[i].channel == channel && frame->samples[i].kind == kind)
            return &frame->samples[i];
    fail_msg("the frame lacks %s", channel_name(channel));
    return NULL;
}

// Whether it is what the file has at the time of `sample`, told by the pose beside it.
static bool is_of_file(const struct sample *sample, double force_n, const struct sample *probe) {
    double way_s = fabs((double)(sample->time_ns - probe->time_ns)) / NS_PER_S;
    double off_n = force_n - force_of(probe->T_mockup_body.translation.x);
    return fabs(off_n) <= 0.006 + newtons_per_s * (way_s + 1 / update_hz);
}

// How many forces of how many frames are those of the file. (On a busy machine an answer comes
// late, and the middle between it and its question is not when it was measured.)
struct seen {
    int frames, sensors, gauges;
};

static void check(const struct frame *frame, struct seen *seen) {
    const struct sample *probe = of(frame, CHANNEL_PROBE, SAMPLE_POSE);
    const struct sample *sensor = of(frame, CHANNEL_PROBE, SAMPLE_FORCE);
    const struct sample *one = of(frame, CHANNEL_TIBIA, SAMPLE_FORCE);
    const struct sample *three = of(frame, CHANNEL_FEMUR, SAMPLE_FORCE);
    if (probe->validity || sensor->validity || one->validity || three->validity)
        return;
    seen->frames++;
    seen->sensors += is_of_file(sensor, sensor->force_n, probe);
    seen->gauges += is_of_file(one, one->force_n - 0.5, probe);
    assert_near(fabs(one->force_n - 0.5), three->force_n, 0.0051);
}

static void the_force_of_a_gauge_and_of_a_sensor_is_that_of_the_file(void **state) {
    (void)state;
    for (int version = 1; version <= 3; version++) {
        const char *path = in_folder("line");
        struct mockup m = start(2, "--motion", in_folder("motion.csv"), "--modbus-rtu", path,
                                "--tracker", "127.0.0.1:0", "--rate", "200", "--header-version",
                                (char[]){(char)('0' + version), 0});
        const struct device_option gauge[] = {{"driver", "modbus"},
                                              {"serial", path},
                                              {"rate_hz", "200"},
                                              {"tibia.force", "38 0.01"},
                                              {"femur.force", "40 f32, 42 f32, 44 f32"},
                                              {"zero.tibia", "-0.5"}};
        const struct device_option tracker[] = {{"driver", "tracker"},
                                                {"address", m.tracker},
                                                {"tool.probe", "probe"},
                                                {"force.probe", "probeForce"}};
        struct runner *runner =
            station((const struct device_option *const[]){gauge, tracker}, (int[]){6, 4}, 2);
        struct seen seen = {0};
        while (seen.frames < 100 || seen.sensors < 60 || seen.gauges < 60) {
            struct frame frame = newest(runner);
            check(&frame, &seen);
            assert_true(seen.frames < 1000);
            usleep(3000);
        }
        for (int i = 0; i < 2; i++) {
            struct device_status status;
            runner_status(runner, i, &status);
            assert_int_equal(0, status.malformed + status.skipped);
        }
        runner_destroy(&runner);
        assert_int_equal(0, ended(&m, SIGTERM));
    }
}

static void a_tracker_that_gives_nothing_but_a_force_is_not_asked_for_poses(void **state) {
    (void)state;
    struct mockup m =
        start(1, "--motion", in_folder("motion.csv"), "--tracker", "127.0.0.1:0", "--rate", "200");
    const struct device_option options[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"force.patella", "probeForce"}};
    struct runner *runner = station((const struct device_option *const[]){options}, (int[]){3}, 1);
    struct device_status status;
    do {
        usleep(3000);
        runner_status(runner, 0, &status);
    } while (status.readings < 20);
    struct frame frame = newest(runner);
    assert_int_equal(frame.count, 1);
    assert_int_equal(frame.samples[0].channel, CHANNEL_PATELLA);
    assert_string_equal("", status.problem);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

// The end of the register's range is no force, and nor is a number that is none.
static void a_gauge_without_a_value_is_held_then_lost(void **state) {
    (void)state;
    const char *path = in_folder("faults.ini");
    FILE *file = fopen(path, "w");
    fputs("[fault a]\nwho = modbus\nwhat = nan\nat_s = 0.5\nfor_s = 100\n"
          "[fault b]\nwho = tracker\nwhat = nan\nat_s = 0.5\nfor_s = 100\n",
          file);
    fclose(file);
    struct mockup m = start(2, "--motion", in_folder("motion.csv"), "--modbus-tcp", "127.0.0.1:0",
                            "--tracker", "127.0.0.1:0", "--faults", path);
    const struct device_option gauge[] = {{"driver", "modbus"},
                                          {"address", m.modbus_tcp},
                                          {"tibia.force", "38 0.01"},
                                          {"femur.force", "40 f32, 42 f32, 44 f32"}};
    const struct device_option tracker[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"force.probe", "probeForce"}};
    struct runner *runner =
        station((const struct device_option *const[]){gauge, tracker}, (int[]){4, 3}, 2);
    static const enum validity wanted[] = {VALIDITY_OK, VALIDITY_HELD, VALIDITY_LOST};
    for (int i = 0, found; i < 3; i += found == 3) {
        struct frame frame = newest(runner);
        found = 0;
        for (int k = 0; k < frame.count; k++)
            found += frame.samples[k].validity == wanted[i] ||
                     (i == 1 && frame.samples[k].validity == VALIDITY_LOST);
        usleep(1000);
    }
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

static int prepare(void **state) {
    int failed = make_folder(state);
    write_motion();
    return failed;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_force_of_a_gauge_and_of_a_sensor_is_that_of_the_file),
        cmocka_unit_test(a_tracker_that_gives_nothing_but_a_force_is_not_asked_for_poses),
        cmocka_unit_test(a_gauge_without_a_value_is_held_then_lost),
    };
    return cmocka_run_group_tests_name("mockup_force", tests, prepare, remove_folder);
}
