// The real mock-up program and the station's devices, over TCP and a serial line.

#include "base/clock.h"
#include "drivers/socket.h"
#include "in_folder.h"
#include "mockup_program.h"
#include "samples/runner.h"
#include "test.h"

#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

// A file with one fault; `value` NULL: none.
static const char *faults(const char *who, const char *what, double at_s, double for_s,
                          const char *value, const char *every) {
    const char *path = in_folder("faults.ini");
    FILE *file = fopen(path, "w");
    fprintf(file, "[fault only]\nwho = %s\nwhat = %s\nat_s = %g\nfor_s = %g\nevery = %s\n", who,
            what, at_s, for_s, every);
    if (value)
        fprintf(file, "value = %s\n", value);
    fclose(file);
    return path;
}

// ---- a motion whose values tell by themselves whether they belong together ----------------------

// u runs from 0 to 1 and back; all is linear in u.
static struct joint_angles joint_of(double u) {
    return (struct joint_angles){100 * u, 20 * u - 10, -30 * u, 8 * u, 4 - 8 * u, 3 * u};
}

static vec3 probe_of(double u) {
    return (vec3){40 * u - 20, 80 - 30 * u, 10 * u};
}

static void write_motion(void) {
    FILE *file = fopen(in_folder("motion.csv"), "w");
    fprintf(file, "t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,"
                  "probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,"
                  "probe_valid,punch_tx_mm,punch_ty_mm,punch_tz_mm,punch_qw,punch_qx,punch_qy,"
                  "punch_qz,punch_valid,punch_opening,touch\n");
    for (int i = 0; i < 200; i++) {
        double u = i < 100 ? i / 100.0 : (200 - i) / 100.0;
        struct joint_angles j = joint_of(u);
        vec3 p = probe_of(u);
        fprintf(file,
                "%.3f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,0.6,0.8,0,0,1,"
                "%.9f,0,0,1,0,0,0,1,%.9f,tibia\n",
                i * 0.01, j.flexion_deg, j.varus_deg, j.internal_deg, j.shift_mm, j.drawer_mm,
                j.distraction_mm, p.x, p.y, p.z, -p.x, u);
    }
    fclose(file);
}

// ---- a station ----------------------------------------------------------------------------------

#define ENCODERS(...)                                                                              \
    {                                                                                              \
        __VA_ARGS__, {"driver", "modbus"}, {"rate_hz", "200"}, {"sequence", "0"},                  \
            {"flexion", "1 0.01"}, {"varus", "2 0.01"}, {"internal", "3 0.01"},                    \
            {"shift", "4 0.01"}, {"drawer", "5 0.01"}, {"distraction", "6 0.01"},                  \
            {"punch.opening", "7 0.0001"}, {"punch.buttons", "8"},                                 \
    }

static struct runner *station(const char *name, const struct device_option *options, int count) {
    struct device_config config = {.options = options, .option_count = count};
    struct runner *runner = NULL;
    struct error err = {{0}};
    strcpy(config.name, name);
    if (runner_create(&config, 1, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return runner;
}

#define station_of(name, options) station(name, options, sizeof options / sizeof *options)

static struct frame collected(struct runner *runner) {
    struct frame frame = {.number = 1};
    runner_collect(runner, clock_now_ns(), &frame);
    assert_true(frame_is_valid(&frame));
    return frame;
}

// Collects until the first sample has this validity; the test's own time limit ends a wait in vain.
static struct frame wait_for(struct runner *runner, enum validity validity) {
    struct frame frame;
    while (frame = collected(runner), frame.samples[0].validity != validity)
        usleep(500);
    return frame;
}

// Collects until `count` different values of the first sample came, and shows each to `check`.
static void watch(struct runner *runner, int count, void (*check)(const struct frame *)) {
    int64_t last_ns = 0;
    while (count) {
        struct frame frame = wait_for(runner, VALIDITY_OK);
        if (frame.samples[0].time_ns != last_ns) {
            check(&frame);
            count--;
        }
        last_ns = frame.samples[0].time_ns;
        usleep(500);
    }
}

static struct device_status status_of(struct runner *runner) {
    struct device_status status;
    runner_status(runner, 0, &status);
    return status;
}

// ---- Modbus -------------------------------------------------------------------------------------

static void check_registers(const struct frame *frame) {
    const double half = 0.0051; // half a register's step, and the rounding of flexion's
    assert_int_equal(2, frame->count);
    struct joint_angles got = frame->samples[0].joint, want = joint_of(got.flexion_deg / 100);
    struct handle handle = frame->samples[1].handle;
    assert_near(got.varus_deg, want.varus_deg, half + 0.001);
    assert_near(got.internal_deg, want.internal_deg, half + 0.0015);
    assert_near(got.shift_mm, want.shift_mm, half);
    assert_near(got.drawer_mm, want.drawer_mm, half);
    assert_near(got.distraction_mm, want.distraction_mm, half);
    if (frame->samples[1].time_ns != frame->samples[0].time_ns)
        return;
    assert_near(handle.opening, got.flexion_deg / 100, 0.0001001);
    if (fabs(handle.opening - 0.05) > 0.001)
        assert_int_equal(handle.opening < 0.05, handle.buttons);
}

static void values_come_over_tcp_within_a_registers_resolution(void **state) {
    (void)state;
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--modbus-tcp", "127.0.0.1:0");
    const struct device_option options[] = ENCODERS({"address", m.modbus_tcp});
    struct runner *runner = station_of("encoders", options);
    watch(runner, 200, check_registers);
    assert_true(status_of(runner).connected);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

// Flexion tells the time: the shaver runs in the second half of the file.
static void check_shaver(const struct frame *frame) {
    const struct sample *joint = &frame->samples[0], *shaver = &frame->samples[1];
    assert_int_equal(2, frame->count);
    assert_int_equal(CHANNEL_SHAVER, shaver->channel);
    if (shaver->time_ns == joint->time_ns && fabs(joint->joint.flexion_deg - 50) > 1.5)
        assert_int_equal(joint->joint.flexion_deg > 50, shaver->handle.buttons);
}

static void the_button_of_a_shaver_is_down_while_it_runs(void **state) {
    (void)state;
    const char *path = in_folder("shaver.csv");
    FILE *file = fopen(path, "w");
    fprintf(file, "t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,"
                  "shaver_tx_mm,shaver_ty_mm,shaver_tz_mm,shaver_qw,shaver_qx,shaver_qy,shaver_qz,"
                  "shaver_valid,shaver_opening\n");
    for (int i = 0; i < 100; i++)
        fprintf(file, "%.3f,%d,0,0,0,0,0,0,0,0,1,0,0,0,1,%d\n", i * 0.01, i, i >= 50);
    fclose(file);
    struct mockup m = start(1, "--motion", path, "--modbus-tcp", "127.0.0.1:0");
    const struct device_option options[] = {
        {"driver", "modbus"},   {"address", m.modbus_tcp}, {"rate_hz", "200"},
        {"sequence", "0"},      {"flexion", "1 0.01"},     {"varus", "2 0.01"},
        {"internal", "3 0.01"}, {"shaver.buttons", "9"},
    };
    struct runner *runner = station_of("encoders", options);
    watch(runner, 250, check_shaver);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
    remove(path);
}

static void values_come_over_a_serial_line_within_a_registers_resolution(void **state) {
    (void)state;
    const char *path = in_folder("line");
    struct mockup m = start(2, "--motion", in_folder("motion.csv"), "--modbus-rtu", path,
                            "--modbus-tcp", "127.0.0.1:0", "--slave", "17", "--modbus-rate", "500");
    assert_string_equal(path, m.modbus_rtu);
    const struct device_option options[] = ENCODERS({"serial", path}, {"slave", "17"});
    struct runner *runner = station_of("encoders", options);
    watch(runner, 200, check_registers);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGINT));
    struct stat info;
    assert_int_not_equal(0, lstat(path, &info));
}

static void late_replies_on_a_serial_line_cost_readings_not_truth(void **state) {
    (void)state;
    const char *path = in_folder("line");
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--modbus-rtu", path,
                            "--faults", faults("modbus", "late", 0, 1000, "60", "25"));
    const struct device_option options[] =
        ENCODERS({"serial", path}, {"timeout_ms", "25"}, {"latency_ms", "150"});
    struct runner *runner = station_of("encoders", options);
    while (status_of(runner).timeouts < 4)
        watch(runner, 10, check_registers);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

static void a_slave_that_falls_silent_is_held_then_lost_then_back(void **state) {
    (void)state;
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--modbus-tcp", "127.0.0.1:0",
                            "--faults", faults("modbus", "dropout", 1.5, 0.8, NULL, "1"));
    const struct device_option options[] = ENCODERS({"address", m.modbus_tcp});
    struct runner *runner = station_of("encoders", options);
    wait_for(runner, VALIDITY_OK);
    while (!status_of(runner).timeouts) // a busy machine is late, too
        usleep(500);
    struct frame held = wait_for(runner, VALIDITY_LOST);
    wait_for(runner, VALIDITY_OK);
    watch(runner, 20, check_registers);
    check_registers(&held); // lost values are the last ones, whole
    assert_true(status_of(runner).losses >= 2); // joint and handle
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

static void a_slave_that_is_started_again_is_found_again(void **state) {
    (void)state;
    const char *path = in_folder("line");
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--modbus-rtu", path);
    const struct device_option options[] = ENCODERS({"serial", path});
    struct runner *runner = station_of("encoders", options);
    wait_for(runner, VALIDITY_OK);
    kill(m.pid, SIGKILL);
    assert_int_equal(-1, ended(&m, 0));
    wait_for(runner, VALIDITY_LOST);
    m = start(1, "--motion", in_folder("motion.csv"), "--modbus-rtu", path); // replaces the link
    watch(runner, 20, check_registers);
    assert_true(status_of(runner).reopenings >= 1);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

// ---- the tracker --------------------------------------------------------------------------------

#define TRACKER_POSE "100 -200 -1500 0.5 0.5 0.5 0.5"
#define TIP_POSE "0 3 150 0.8 0 0.6 0"
// The inverse of TRACKER_POSE: the axes go round the other way.
#define MOCKUP_POSE "200 1500 -100 0.5 -0.5 -0.5 -0.5"

static void check_probe(const struct frame *frame) {
    assert_int_equal(1, frame->count);
    assert_int_equal(CHANNEL_PROBE, frame->samples[0].channel);
    pose got = frame->samples[0].T_mockup_body;
    vec3 want = probe_of((got.translation.x + 20) / 40);
    assert_vec3_near(got.translation, want, 2e-3); // floats at 1.5 m
    assert_near(quat_angle(got.rotation, (quat){0.6, 0.8, 0, 0}), 0, 1e-5);
}

static void every_message_and_header_version_brings_the_tip_to_the_mockup(void **state) {
    (void)state;
    static const char *const types[] = {"TRANSFORM", "TDATA", "POSITION", "QTDATA"};
    static const char *const versions[] = {"1", "2", "3"};
    for (int i = 0; i < 12; i++) {
        struct mockup m =
            start(1, "--motion", in_folder("motion.csv"), "--tracker", "127.0.0.1:0", "--message",
                  types[i % 4], "--header-version", versions[i / 4], "--rate", "300",
                  "--T-tracker-mockup", TRACKER_POSE, "--T-tool-tip", "probe=" TIP_POSE);
        const struct device_option options[] = {{"driver", "tracker"},
                                                {"address", m.tracker},
                                                {"tool.probe", "probe"},
                                                {"tip.probe", TIP_POSE},
                                                {"T_mockup_tracker", MOCKUP_POSE}};
        struct runner *runner = station_of("camera", options);
        watch(runner, 30, check_probe);
        struct device_status status = status_of(runner);
        assert_int_equal(0, status.malformed);
        assert_int_equal(0, status.skipped);
        assert_int_equal(0, status.jumps);
        runner_destroy(&runner);
        assert_int_equal(0, ended(&m, SIGTERM));
    }
}

static void a_tracker_that_sends_only_when_asked_is_asked(void **state) {
    (void)state;
    static const struct {
        const char *message, *version, *request;
    } rows[] = {{"TDATA", "2", "auto"},
                {"TDATA", "1", "TDATA"},
                {"TDATA", "3", "QTDATA"},
                {"TRANSFORM", "3", "auto"},
                {"POSITION", "2", "POSITION"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct mockup m =
            start(1, "--motion", in_folder("motion.csv"), "--tracker", "127.0.0.1:0",
                  "--when-asked", "--message", rows[i].message, "--header-version", rows[i].version,
                  "--T-tracker-mockup", TRACKER_POSE, "--T-tool-tip", "probe=" TIP_POSE);
        const struct device_option options[] = {{"driver", "tracker"},
                                                {"address", m.tracker},
                                                {"tool.probe", "probe"},
                                                {"tip.probe", TIP_POSE},
                                                {"T_mockup_tracker", MOCKUP_POSE},
                                                {"request", rows[i].request}};
        struct runner *runner = station_of("camera", options);
        watch(runner, 30, check_probe);
        assert_int_equal(0, status_of(runner).malformed);
        runner_destroy(&runner);
        assert_int_equal(0, ended(&m, SIGTERM));
    }
}

static void a_tracker_that_vanishes_is_held_lost_and_found_again(void **state) {
    (void)state;
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--tracker", "127.0.0.1:0");
    const struct device_option options[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"tool.probe", "probe"}};
    struct runner *runner = station_of("camera", options);
    watch(runner, 10, check_probe);
    kill(m.pid, SIGKILL);
    assert_int_equal(-1, ended(&m, 0));
    wait_for(runner, VALIDITY_HELD);
    wait_for(runner, VALIDITY_LOST);
    while (!strstr(status_of(runner).problem, "refused"))
        usleep(1000);
    assert_false(status_of(runner).connected);
    m = start(1, "--motion", in_folder("motion.csv"), "--tracker", m.tracker);
    watch(runner, 10, check_probe);
    struct device_status status = status_of(runner);
    assert_true(status.losses >= 1);
    assert_true(status.reopenings >= 1);
    assert_string_equal("", status.problem);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

static void a_silent_tracker_keeps_its_connection(void **state) {
    (void)state;
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--tracker", "127.0.0.1:0",
                            "--faults", faults("tracker", "dropout", 1.5, 0.6, NULL, "1"));
    const struct device_option options[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"tool.probe", "probe"}, {"hold_ms", "50"}};
    struct runner *runner = station_of("camera", options);
    wait_for(runner, VALIDITY_OK);
    wait_for(runner, VALIDITY_LOST);
    watch(runner, 10, check_probe);
    assert_int_equal(0, status_of(runner).reopenings);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

// What PLUS sends of a tool out of view: a pose, and that it means nothing.
static void a_tool_that_is_said_to_be_missing_is_lost(void **state) {
    (void)state;
    struct mockup m = start(1, "--motion", in_folder("motion.csv"), "--tracker", "127.0.0.1:0",
                            "--header-version", "2", "--message", "TDATA", "--faults",
                            faults("tracker", "missing", 0.5, 0.4, NULL, "1"));
    const struct device_option options[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"tool.probe", "probe"}, {"hold_ms", "50"}};
    struct runner *runner = station_of("camera", options);
    wait_for(runner, VALIDITY_OK);
    while (!strstr(status_of(runner).problem, "reports no value"))
        wait_for(runner, VALIDITY_LOST); // it may be late, too
    watch(runner, 10, check_probe);
    assert_int_equal(0, status_of(runner).jumps);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

// ---- recordings ---------------------------------------------------------------------------------

// 50 rows at 50 Hz, of which row 25 lies far away, and row 40 is not valid.
static void write_glitch(void) {
    FILE *file = fopen(in_folder("glitch.csv"), "w");
    fputs("t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid\n", file);
    for (int i = 0; i < 50; i++) {
        double far = i == 25 ? 0 : -1500, x = 0.01 * i;
        fprintf(file, "%.3f,%g,%g,%g,1,0,0,0,%d\n", i * 0.02, x, far, far, i != 40);
    }
    fclose(file);
}

static void check_no_glitch(const struct frame *frame) {
    assert_near(frame->samples[0].T_mockup_body.translation.y, -1500, 1);
}

static void a_glitch_of_the_tracker_never_reaches_a_frame(void **state) {
    (void)state;
    struct mockup m = start(1, "--recording", in_folder("glitch.csv"), "--tool", "probe",
                            "--tracker", "127.0.0.1:0", "--message", "TRANSFORM");
    const struct device_option options[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"tool.probe", "probe"}};
    struct runner *runner = station_of("camera", options);
    while (status_of(runner).jumps < 3)
        watch(runner, 1, check_no_glitch);
    assert_int_equal(0, status_of(runner).malformed);
    runner_destroy(&runner);
    assert_int_equal(0, ended(&m, SIGTERM));
}

// ---- many clients, foreign bytes ----------------------------------------------------------------

static void strangers_do_not_disturb(void **state) {
    (void)state;
    struct mockup m = start(2, "--motion", in_folder("motion.csv"), "--modbus-tcp", "127.0.0.1:0",
                            "--tracker", "127.0.0.1:0");
    const struct device_option encoders[] = ENCODERS({"address", m.modbus_tcp});
    const struct device_option camera[] = {
        {"driver", "tracker"}, {"address", m.tracker}, {"tool.probe", "probe"}};
    struct runner *one = station_of("encoders", encoders), *two = station_of("encoders", encoders);
    struct runner *three = station_of("camera", camera), *four = station_of("camera", camera);
    for (int i = 0; i < 30; i++) {
        int fd;
        struct error err;
        const char *address = i % 2 ? m.modbus_tcp : m.tracker;
        assert_int_equal(RESULT_OK, socket_connect(address, 1000, &fd, &err));
        assert_int_equal(18, send(fd, "GET / HTTP/1.1\r\n\r\n", 18, MSG_NOSIGNAL));
        watch(i % 2 ? one : three, 2, i % 2 ? check_registers : check_probe);
        close(fd);
    }
    watch(two, 10, check_registers);
    watch(four, 10, check_probe);
    assert_int_equal(0, status_of(one).reopenings + status_of(three).reopenings);
    runner_destroy(&one);
    runner_destroy(&two);
    runner_destroy(&three);
    runner_destroy(&four);
    assert_int_equal(0, ended(&m, SIGTERM));
}

static int prepare(void **state) {
    int failed = make_folder(state);
    write_motion();
    write_glitch();
    return failed;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_come_over_tcp_within_a_registers_resolution),
        cmocka_unit_test(the_button_of_a_shaver_is_down_while_it_runs),
        cmocka_unit_test(values_come_over_a_serial_line_within_a_registers_resolution),
        cmocka_unit_test(late_replies_on_a_serial_line_cost_readings_not_truth),
        cmocka_unit_test(a_slave_that_falls_silent_is_held_then_lost_then_back),
        cmocka_unit_test(a_slave_that_is_started_again_is_found_again),
        cmocka_unit_test(every_message_and_header_version_brings_the_tip_to_the_mockup),
        cmocka_unit_test(a_tracker_that_sends_only_when_asked_is_asked),
        cmocka_unit_test(a_tracker_that_vanishes_is_held_lost_and_found_again),
        cmocka_unit_test(a_silent_tracker_keeps_its_connection),
        cmocka_unit_test(a_tool_that_is_said_to_be_missing_is_lost),
        cmocka_unit_test(a_glitch_of_the_tracker_never_reaches_a_frame),
        cmocka_unit_test(strangers_do_not_disturb),
    };
    return cmocka_run_group_tests_name("mockup", tests, prepare, remove_folder);
}
