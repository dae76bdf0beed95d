// Recordings and configs: no hardware, no sockets.

#include "base/clock.h"
#include "drivers/recording.h"
#include "in_folder.h"
#include "samples/runner.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

// ---- recordings ---------------------------------------------------------------------------------

static const char *written(const char *name, const char *text) {
    static char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    return path;
}

#define PLAIN "t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid\n"
#define JOINT "t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm"
#define PROBE "probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,probe_valid"
#define ROW "0,1,2,3,1,0,0,0,1\n"

static void recordings_that_are_wrong_are_refused_with_their_place(void **state) {
    (void)state;
    static const struct {
        const char *text, *says;
        enum channel unnamed;
    } rows[] = {
        {"", "is empty", CHANNEL_PROBE},
        {PLAIN, "has no rows", CHANNEL_PROBE},
        {"time,tx_mm\n", ":1: column t_seconds is missing", CHANNEL_PROBE},
        {"t_seconds,tx_mm\n0,1\n", ":1: column ", CHANNEL_PROBE},
        {"t_seconds,x\n0,1\n", ":1: no columns tx_mm", CHANNEL_PROBE},
        {"t_seconds,x\n0,1\n", ":1: neither joint nor tool", CHANNEL_COUNT},
        {PLAIN ROW, ":1: one tool without a name", CHANNEL_COUNT},
        {JOINT "\n0,1,2,3,4,5,6\n", ":1: no columns tx_mm", CHANNEL_PROBE},
        {"t_seconds,flexion_deg\n0,1\n", ":1: column distraction_mm is missing", CHANNEL_COUNT},
        {JOINT ",probe_tx_mm\n0,1,2,3,4,5,6,7\n", ":1: column probe_valid is missing",
         CHANNEL_COUNT},
        {PLAIN ROW "1,1,2,3,1,0,0,0\n", ":3: 8 columns where the first row has 9", CHANNEL_PROBE},
        {PLAIN ROW "1,1,2,3,1,0,0,0,1,7\n", ":3: 10 columns", CHANNEL_PROBE},
        {PLAIN ROW "\n", ":3: 1 columns", CHANNEL_PROBE},
        {PLAIN ROW "1,1,2,x,1,0,0,0,1\n", ":3: tz_mm: \"x\" is not a number", CHANNEL_PROBE},
        {PLAIN ROW "1,1,2,,1,0,0,0,1\n", ":3: tz_mm: \"\" is not a number", CHANNEL_PROBE},
        {PLAIN ROW "1,1,2,3mm,1,0,0,0,1\n", ":3: tz_mm: \"3mm\"", CHANNEL_PROBE},
        {PLAIN ROW "1,nan,2,3,1,0,0,0,1\n", ":3: tx_mm: \"nan\"", CHANNEL_PROBE},
        {PLAIN ROW "1,inf,2,3,1,0,0,0,1\n", ":3: tx_mm: \"inf\"", CHANNEL_PROBE},
        {PLAIN ROW "1,1,2,3,1,0,0,0,2\n", ":3: valid: 2 is neither 0 nor 1", CHANNEL_PROBE},
        {PLAIN ROW "1,1,2,3,0,0,0,0,1\n", ":3: qw: the quaternion's length is 0", CHANNEL_PROBE},
        {PLAIN ROW "0,1,2,3,1,0,0,0,1\n", ":3: t_seconds: 0 does not follow 0", CHANNEL_PROBE},
        {PLAIN "1,1,2,3,1,0,0,0,1\n" ROW, ":3: t_seconds: 0 does not follow 1", CHANNEL_PROBE},
        {"t_seconds," PROBE ",probe_opening\n0,1,2,3,1,0,0,0,1,1.5\n",
         ":2: probe_opening: 1.5 is not from 0 to 1", CHANNEL_COUNT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct recording r;
        struct error err = {{0}};
        const char *path = written("bad.csv", rows[i].text);
        if (recording_read(path, rows[i].unnamed, &r, &err) == RESULT_OK)
            fail_msg("row %zu was read", i);
        if (!strstr(err.text, rows[i].says) || !strstr(err.text, path))
            fail_msg("row %zu: \"%s\" does not say \"%s\"", i, err.text, rows[i].says);
        recording_fini(&r);
    }
}

static void a_line_or_a_row_without_end_is_refused(void **state) {
    (void)state;
    static char text[20000];
    struct recording r;
    struct error err;
    memset(text, '1', sizeof text - 1);
    assert_int_equal(RESULT_LIMIT,
                     recording_read(written("long.csv", text), CHANNEL_PROBE, &r, &err));
    memset(text, ',', 5000);
    text[5000] = 0;
    assert_int_equal(RESULT_LIMIT,
                     recording_read(written("wide.csv", text), CHANNEL_PROBE, &r, &err));
    assert_int_equal(RESULT_MISSING, recording_read("/nowhere.csv", CHANNEL_PROBE, &r, &err));
    assert_int_equal(RESULT_IO, recording_read("/tmp", CHANNEL_PROBE, &r, &err));
}

static void a_motion_file_is_read_and_interpolated(void **state) {
    (void)state;
    struct recording r;
    struct error err;
    const char *path = written("motion.csv", "note," JOINT ",punch_opening," PROBE ",touch\r\n"
                                             "a,10,0,0,0,0,0,0,9,0,0,0,1,0,0,0,1,tibia\r\n"
                                             "b,12,90,4,0,-8,0,2,9,4,0,0,0,1,0,0,1,-\r\n"
                                             "c,13,0,0,0,0,0,0,9,4,0,0,0,0,0,0,0,-\r\n");
    assert_int_equal(RESULT_OK, recording_read(path, CHANNEL_COUNT, &r, &err));
    assert_int_equal(3, r.row_count);
    assert_int_equal(1, r.tool_count);
    assert_int_equal(CHANNEL_PROBE, r.tools[0].channel);
    assert_false(r.tools[0].has_opening);
    assert_false(r.tools[0].states[2].valid);
    assert_near(recording_period(&r), 4.5, 1e-12);
    struct joint_angles j = recording_joint_at(&r, 11);
    assert_near(j.flexion_deg, 45, 1e-12);
    assert_near(j.shift_mm, -4, 1e-12);
    assert_near(j.distraction_mm, 1, 1e-12);
    struct recording_state s = recording_tool_at(&r, 0, 10.5);
    assert_vec3_near(s.pose.translation, ((vec3){1, 0, 0}), 1e-12);
    assert_near(quat_angle(s.pose.rotation, quat_identity()), 45 * RAD_PER_DEG, 1e-9);
    assert_true(recording_tool_at(&r, 0, 12.5).valid);
    assert_near(recording_tool_at(&r, 0, 12.9).pose.translation.x, 4, 0);
    static const double times[] = {-5, 10, 11.9, 12, 12.99, 13, 99};
    static const int rows[] = {0, 0, 0, 1, 1, 2, 2};
    for (int i = 0; i < 7; i++)
        assert_int_equal(rows[i], recording_row_at(&r, times[i]));
    assert_near(recording_joint_at(&r, 99).flexion_deg, 0, 0);
    assert_near(recording_joint_at(&r, -9).flexion_deg, 0, 0);
    recording_fini(&r);
}

// ---- configs ------------------------------------------------------------------------------------

#define OPTIONS_MAX 12

struct section {
    const char *name;
    struct device_option options[OPTIONS_MAX];
};

static int configs_of(const struct section *sections, struct device_config *out) {
    int count = 0;
    for (; count < 3 && sections[count].name; count++) {
        struct device_config *c = &out[count];
        *c = (struct device_config){.options = sections[count].options};
        strcpy(c->name, sections[count].name);
        while (c->option_count < OPTIONS_MAX && c->options[c->option_count].key)
            c->option_count++;
    }
    return count;
}

#define MODBUS                                                                                     \
    {"driver", "modbus"}, {                                                                        \
        "address", "127.0.0.1:9"                                                                   \
    }
#define LONG_NAME /* of 128 bytes */                                                               \
    "a name of 32 bytes, which is nota name of 32 bytes, which is not"                             \
    "a name of 32 bytes, which is nota name of 32 bytes, which is not"

#define TRACKER                                                                                    \
    {"driver", "tracker"}, {                                                                       \
        "address", "127.0.0.1:9"                                                                   \
    }
#define SIMULATED                                                                                  \
    { "driver", "simulated" }

static void configs_that_are_wrong_are_refused_with_device_and_key(void **state) {
    (void)state;
    static const struct {
        struct section sections[3];
        const char *says;
    } rows[] = {
        {{{"a", {{"seed", "1"}}}}, "[device a] driver: is required"},
        {{{"a", {{"driver", "vrpn"}}}},
         "[device a] driver: no driver is named \"vrpn\"; there are modbus, hid, tracker"},
        {{{"a", {{"driver", "modbsu"}}}},
         "driver: no driver is named \"modbsu\"; did you mean modbus?"},
        {{{"a", {SIMULATED, {"colour", "red"}}}},
         "[device a] colour: unknown key; there are seed, rate_hz"},
        {{{"a", {SIMULATED, {"hold_sm", "9"}}}},
         "[device a] hold_sm: unknown key; did you mean hold_ms?"},
        {{{"a", {TRACKER, {"tool.prob", "x"}}}},
         "[device a] tool.prob: unknown key; did you mean tool.probe?"},
        {{{"a", {MODBUS, {"punsh.opening", "8"}}}},
         "[device a] punsh.opening: unknown key; did you mean punch.opening?"},
        {{{"a", {SIMULATED, {"seed", "1"}, {"seed", "2"}}}}, "[device a] seed: given twice"},
        {{{"a", {SIMULATED, {"hold_ms", "1"}, {"hold_ms", "2"}}}},
         "[device a] hold_ms: given twice"},
        {{{"a", {SIMULATED, {"hold_ms", "-1"}}}}, "[device a] hold_ms: \"-1\" is not a number"},
        {{{"a", {SIMULATED, {"jump_mm", "far"}}}}, "[device a] jump_mm: \"far\""},
        {{{"a", {SIMULATED, {"rate_hz", "0"}}}}, "[device a] rate_hz"},
        {{{"a", {SIMULATED, {"rate_hz", "nan"}}}}, "[device a] rate_hz"},
        {{{"a", {SIMULATED, {"seed", "1.5"}}}}, "[device a] seed: \"1.5\" is not a whole number"},
        {{{"a", {SIMULATED}}, {"b", {SIMULATED}}},
         "[device a] and [device b]: both give flexion of the joint"},
        {{{"a", {SIMULATED}}, {"a", {SIMULATED}}}, "[device a]: two devices have this name"},
        {{{"a", {SIMULATED}}, {"b", {TRACKER, {"tool.probe", "x"}}}},
         "both give the pose of channel probe"},
        {{{"a", {{"driver", "modbus"}}}}, "[device a] address: one of address and serial"},
        {{{"a", {MODBUS}}}, "[device a]: the section names no register, as flexion = 1 does"},
        {{{"a", {MODBUS, {"serial", "/dev/x"}}}}, "[device a] address: one of address and serial"},
        {{{"a",
           {{"driver", "modbus"}, {"serial", "/dev/x"}, {"baud", "250000"}, {"flexion", "1"}}}},
         "[device a] baud: 250000 is not a rate that a serial line has"},
        {{{"a", {{"driver", "modbus"}, {"serial", "/dev/x"}, {"slave", "255"}}}}, "from 1 to 247"},
        {{{"a", {MODBUS, {"slave", "250"}}}}, "250 is neither a number from 0 to 247 nor 255"},
        {{{"a", {TRACKER, {"tool.instrument_6", "x"}}}}, "tool.instrument_6: unknown key"},
        {{{"a", {MODBUS, {"baud", "9600"}}}}, "[device a] baud: only a serial line"},
        {{{"a", {MODBUS, {"flexion", "70000"}}}}, "[device a] flexion: \"70000\" is not REGISTER"},
        {{{"a", {MODBUS, {"flexion", "1.5"}}}}, "[device a] flexion"},
        {{{"a", {MODBUS, {"flexion", "-1"}}}}, "[device a] flexion"},
        {{{"a", {MODBUS, {"flexion", ""}}}}, "[device a] flexion"},
        {{{"a", {MODBUS, {"flexion", "1 2 3 4"}}}}, "[device a] flexion"},
        {{{"a", {MODBUS, {"flexion", "1 x"}}}}, "[device a] flexion"},
        {{{"a", {MODBUS, {"flexion", "1 signed 0.1"}}}}, "[device a] flexion"},
        {{{"a", {MODBUS, {"punch.buttons", "8 1"}}}}, "[device a] punch.buttons: \"8 1\" is not"},
        {{{"a", {MODBUS, {"tibia.opening", "8"}}}}, "[device a] tibia.opening: unknown key"},
        {{{"a", {MODBUS, {"hammer.opening", "8"}}}}, "[device a] hammer.opening: unknown key"},
        {{{"a", {MODBUS, {"flexion", "1"}, {"varus", "500"}}}}, "[device a]: registers 1 to 500"},
        {{{"a", {MODBUS, {"flexion", "1"}, {"timeout_ms", "2001"}}}}, "[device a] timeout_ms"},
        {{{"a", {MODBUS, {"flexion", "1"}, {"slave", "256"}}}}, "[device a] slave"},
        {{{"a", {{"driver", "modbus"}, {"address", "nowhere"}, {"flexion", "1"}}}},
         "[device a] address: \"nowhere\" is not host:port"},
        {{{"a", {{"driver", "modbus"}, {"serial", "/dev/x"}, {"parity", "maybe"}}}},
         "[device a] parity: \"maybe\""},
        {{{"a", {TRACKER}}}, "[device a] tool.CHANNEL: is required"},
        {{{"a", {{"driver", "tracker"}, {"tool.probe", "x"}}}}, "[device a] address: is required"},
        {{{"a", {TRACKER, {"tool.hammer", "x"}}}}, "[device a] tool.hammer: unknown key"},
        {{{"a", {TRACKER, {"tool.joint", "x"}}}}, "[device a] tool.joint: the joint is not a tool"},
        {{{"a", {TRACKER, {"tool.probe", LONG_NAME}}}}, "[device a] tool.probe"},
        {{{"a", {TRACKER, {"tool.probe", "x"}, {"tip.probe", "1 2"}}}}, "[device a] tip.probe"},
        {{{"a", {TRACKER, {"tool.probe", "x"}, {"T_mockup_tracker", "0 0 0 2 0 0 0"}}}},
         "[device a] T_mockup_tracker"},
        {{{"a", {{"driver", "recorded"}}}}, "[device a] file: is required"},
        {{{"a", {{"driver", "recorded"}, {"file", "/nowhere.csv"}, {"channel", "probe"}}}},
         "[device a] file: /nowhere.csv: "},
        {{{"a", {{"driver", "recorded"}, {"file", "x"}, {"channel", "hammer"}}}},
         "[device a] channel: \"hammer\" is not a channel; there are joint, "},
        {{{"a", {{"driver", "recorded"}, {"file", "x"}, {"loop", "maybe"}}}}, "[device a] loop"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct device_config configs[3];
        struct runner *runner = NULL;
        struct error err = {{0}};
        int count = configs_of(rows[i].sections, configs);
        if (runner_create(configs, count, &runner, &err) == RESULT_OK)
            fail_msg("row %zu was taken; it should say \"%s\"", i, rows[i].says);
        assert_null(runner);
        if (!strstr(err.text, rows[i].says))
            fail_msg("row %zu: \"%s\" does not say \"%s\"", i, err.text, rows[i].says);
    }
}

static void more_devices_than_there_may_be_are_refused(void **state) {
    (void)state;
    static struct device_config configs[RUNNER_DEVICES_MAX + 1];
    struct runner *runner = NULL;
    assert_int_equal(RESULT_LIMIT, runner_create(configs, RUNNER_DEVICES_MAX + 1, &runner, NULL));
}

// ---- running ------------------------------------------------------------------------------------

static struct runner *started(const struct section *sections) {
    struct device_config configs[3];
    struct runner *runner = NULL;
    struct error err = {{0}};
    int count = configs_of(sections, configs);
    if (runner_create(configs, count, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return runner;
}

static void a_simulated_station_gives_whole_frames(void **state) {
    (void)state;
    const struct section sections[3] = {
        {"hands", {SIMULATED, {"seed", "5"}, {"rate_hz", "500"}, {"noise_mm", "0.1"}}}};
    struct runner *runner = started(sections);
    assert_int_equal(1, runner_count(runner));
    struct device_status status;
    int valid = 0;
    do {
        struct frame frame = {.number = 1};
        runner_collect(runner, clock_now_ns(), &frame);
        assert_int_equal(2, frame.count);
        assert_true(frame_is_valid(&frame));
        valid +=
            frame.samples[0].validity == VALIDITY_OK && frame.samples[1].validity == VALIDITY_OK;
        runner_status(runner, 0, &status);
        usleep(1000);
    } while (status.readings < 100 || valid < 20);
    assert_true(status.connected);
    assert_string_equal("hands", status.name);
    assert_string_equal("simulated", status.driver);
    assert_int_equal(0, status.malformed);
    assert_int_equal(0, status.jumps);
    runner_destroy(&runner);
    assert_null(runner);
    runner_destroy(&runner);
}

static void a_station_whose_devices_are_absent_starts_and_ends_at_once(void **state) {
    (void)state;
    const struct section sections[3] = {
        {"encoders", {MODBUS, {"flexion", "1"}}},
        {"serial", {{"driver", "modbus"}, {"serial", "/dev/nowhere"}, {"punch.opening", "1"}}},
        {"camera", {TRACKER, {"tool.probe", "probe"}}}};
    struct runner *runner = started(sections);
    struct device_status status[3];
    do {
        for (int i = 0; i < 3; i++)
            runner_status(runner, i, &status[i]);
        usleep(1000);
    } while (!status[0].problem[0] || !status[1].problem[0] || !status[2].problem[0]);
    struct frame frame = {.number = 1};
    runner_collect(runner, clock_now_ns(), &frame);
    assert_int_equal(3, frame.count);
    assert_true(frame_is_valid(&frame));
    for (int i = 0; i < 3; i++) {
        assert_false(status[i].connected);
        assert_int_equal(VALIDITY_LOST, frame.samples[i].validity);
        assert_int_equal(i, frame.samples[i].device);
    }
    assert_non_null(strstr(status[0].problem, "127.0.0.1:9"));
    assert_non_null(strstr(status[1].problem, "/dev/nowhere"));
    runner_destroy(&runner);
}

// Frames and tips: p_mockup = T_mockup_tracker · T_tracker_tool · T_tool_tip · p_tip.
static void a_recording_goes_through_tracker_and_tip_to_the_mockup(void **state) {
    (void)state;
    const char *path = written("still.csv", PLAIN "0,1,2,3,0,1,0,0,1\n0.01,1,2,3,0,1,0,0,1\n");
    const struct section sections[3] = {{"hand",
                                         {{"driver", "recorded"},
                                          {"file", path},
                                          {"channel", "scope"},
                                          {"T_mockup_tracker", "10 0 0 0 0 0 1"},
                                          {"tip.scope", "0 5 0 1 0 0 0"}}}};
    struct runner *runner = started(sections);
    struct frame frame;
    do {
        frame = (struct frame){.number = 1};
        runner_collect(runner, clock_now_ns(), &frame);
        usleep(1000);
    } while (frame.samples[0].validity != VALIDITY_OK);
    assert_int_equal(CHANNEL_SCOPE, frame.samples[0].channel);
    // tip (0,5,0) turned about x: (0,-5,0), moved: (1,-3,3), turned about z: (-1,3,3), moved.
    assert_vec3_near(frame.samples[0].T_mockup_body.translation, ((vec3){9, 3, 3}), 1e-12);
    runner_destroy(&runner);
}

// Eleven tools with pose, opening and force: more than a frame has room for.
static void a_recording_of_more_than_a_frame_holds_is_refused(void **state) {
    (void)state;
    static const char *const columns[] = {"tx_mm", "ty_mm", "tz_mm", "qw",      "qx",
                                          "qy",    "qz",    "valid", "opening", "force_n"};
    const char *path = in_folder("all.csv");
    FILE *file = fopen(path, "w");
    fputs("t_seconds", file);
    for (int c = CHANNEL_JOINT + 1; c < CHANNEL_COUNT; c++)
        for (int i = 0; i < 10; i++)
            fprintf(file, ",%s_%s", channel_name((enum channel)c), columns[i]);
    fputs("\n0", file);
    for (int c = CHANNEL_JOINT + 1; c < CHANNEL_COUNT; c++)
        fputs(",1,2,3,1,0,0,0,1,0.5,-2", file);
    fputs("\n", file);
    fclose(file);
    const struct device_option options[] = {{"driver", "recorded"}, {"file", path}};
    const struct device_config config = {"all", options, 2};
    struct runner *runner = NULL;
    struct error err;
    assert_int_equal(RESULT_LIMIT, runner_create(&config, 1, &runner, &err));
    assert_non_null(strstr(err.text, "the devices give 33 channels, more than 22"));
}

static void a_recording_that_does_not_loop_ends_lost(void **state) {
    (void)state;
    const char *path = written("short.csv", PLAIN "0,1,2,3,1,0,0,0,1\n0.02,1,2,3,1,0,0,0,1\n");
    const struct section sections[3] = {
        {"hand", {{"driver", "recorded"}, {"file", path}, {"channel", "probe"}, {"loop", "no"}}}};
    struct runner *runner = started(sections);
    struct device_status status;
    do {
        usleep(1000);
        runner_status(runner, 0, &status);
    } while (!status.losses);
    assert_int_equal(2, status.readings);
    assert_int_equal(1, status.losses);
    assert_non_null(strstr(status.problem, "has ended"));
    runner_destroy(&runner);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(recordings_that_are_wrong_are_refused_with_their_place),
        cmocka_unit_test(a_line_or_a_row_without_end_is_refused),
        cmocka_unit_test(a_motion_file_is_read_and_interpolated),
        cmocka_unit_test(configs_that_are_wrong_are_refused_with_device_and_key),
        cmocka_unit_test(more_devices_than_there_may_be_are_refused),
        cmocka_unit_test(a_simulated_station_gives_whole_frames),
        cmocka_unit_test(a_station_whose_devices_are_absent_starts_and_ends_at_once),
        cmocka_unit_test(a_recording_goes_through_tracker_and_tip_to_the_mockup),
        cmocka_unit_test(a_recording_that_does_not_loop_ends_lost),
        cmocka_unit_test(a_recording_of_more_than_a_frame_holds_is_refused),
    };
    return cmocka_run_group_tests_name("device", tests, make_folder, remove_folder);
}
