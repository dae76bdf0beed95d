// Samples of one frame are of one time: what came sooner is taken from its past.

#include "base/clock.h"
#include "in_folder.h"
#include "samples/past.h"
#include "samples/runner.h"
#include "test.h"

#include <stdio.h>
#include <unistd.h>

static struct sample joint(int64_t ms, double flexion_deg) {
    return (struct sample){.channel = CHANNEL_JOINT,
                           .kind = SAMPLE_JOINT,
                           .time_ns = ms * NS_PER_MS,
                           .joint = {.flexion_deg = flexion_deg}};
}

static double flexion_at(const struct past *past, double ms) {
    struct sample sample;
    assert_true(past_at(past, (int64_t)(ms * NS_PER_MS), &sample));
    return sample.joint.flexion_deg;
}

// ---- the past --------------------------------------------------------------------------------

static void between_two_samples_it_is_between_them(void **state) {
    (void)state;
    static struct past past;
    for (int i = 0; i < 3000; i++) {
        struct sample sample = joint(10 * i, 2 * i);
        past_add(&past, &sample);
    }
    for (int i = 3000 - PAST_SAMPLES; i < 2999; i++) {
        assert_near(flexion_at(&past, 10 * i), 2 * i, 1e-9);
        assert_near(flexion_at(&past, 10 * i + 2.5), 2 * i + 0.5, 1e-9);
    }
}

// At 2000 Hz, with a sample now and then between: as far back as a delay may be.
static void a_fast_source_keeps_more_than_a_second(void **state) {
    (void)state;
    static struct past past;
    for (int i = 0; i < 10000; i++) {
        struct sample sample = joint(0, 0.5 * i);
        sample.time_ns = i * (NS_PER_MS / 2) + (i % 3) * 1000;
        past_add(&past, &sample);
    }
    for (int ms = 3900; ms < 4999; ms++)
        assert_near(flexion_at(&past, ms), ms, 0.01);
}

static void past_its_ends_it_stays_and_says_when_it_was(void **state) {
    (void)state;
    static struct past past;
    struct sample sample, first = joint(100, 10), last = joint(110, 30);
    assert_false(past_at(&past, 0, &sample));
    past_add(&past, &first);
    past_add(&past, &last);
    assert_true(past_at(&past, 50 * NS_PER_MS, &sample));
    assert_int_equal(sample.time_ns, 100 * NS_PER_MS);
    assert_near(sample.joint.flexion_deg, 10, 0);
    assert_true(past_at(&past, 150 * NS_PER_MS, &sample));
    assert_int_equal(sample.time_ns, 110 * NS_PER_MS);
    assert_near(sample.joint.flexion_deg, 30, 0);
    past_forget(&past);
    assert_false(past_at(&past, 105 * NS_PER_MS, &sample));
}

static void a_force_is_of_the_time_of_the_poses(void **state) {
    (void)state;
    static struct past past;
    struct sample at, sample = {.channel = CHANNEL_PROBE, .kind = SAMPLE_FORCE};
    for (int i = 0; i < 5; i++) {
        sample.time_ns = 10 * i * NS_PER_MS;
        sample.force_n = 2 * i;
        past_add(&past, &sample);
    }
    assert_true(past_at(&past, 25 * NS_PER_MS, &at));
    assert_int_equal(at.time_ns, 25 * NS_PER_MS);
    assert_near(at.force_n, 5, 1e-12);
}

static void a_press_has_its_own_time(void **state) {
    (void)state;
    static struct past past;
    struct sample at, sample = {.channel = CHANNEL_PUNCH, .kind = SAMPLE_HANDLE, .time_ns = 1};
    past_add(&past, &sample);
    assert_false(past_at(&past, 1, &at));
}

static void a_pose_turns_halfway(void **state) {
    (void)state;
    static struct past past;
    struct sample at, sample = {.channel = CHANNEL_PROBE, .kind = SAMPLE_POSE, .time_ns = 0};
    quat turned = quat_from_axis_angle((vec3){0, 0, 1}, 1);
    sample.T_mockup_body = pose_identity();
    past_add(&past, &sample);
    sample.time_ns = 10 * NS_PER_MS;
    sample.T_mockup_body = (pose){turned, {4, 0, 0}};
    past_add(&past, &sample);
    assert_true(past_at(&past, 5 * NS_PER_MS, &at));
    assert_near(at.T_mockup_body.translation.x, 2, 1e-12);
    assert_near(quat_angle(at.T_mockup_body.rotation, turned), 0.5, 1e-12);
}

// ---- a station ----------------------------------------------------------------------------------

#define DEG_PER_S 60
#define MM_PER_S 20
#define DELAY_MS 40

static void write_motions(char joint_path[FOLDER_MAX + 16], char probe_path[FOLDER_MAX + 16]) {
    snprintf(joint_path, FOLDER_MAX + 16, "%s/joint.csv", folder);
    snprintf(probe_path, FOLDER_MAX + 16, "%s/probe.csv", folder);
    FILE *joints = fopen(joint_path, "w"), *probes = fopen(probe_path, "w");
    assert_true(joints && probes);
    fputs("t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm\n",
          joints);
    fputs("t_seconds,probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,"
          "probe_valid\n",
          probes);
    for (int i = 0; i < 40 * 200; i++)
        fprintf(joints, "%.3f,%.9f,0,0,0,0,0\n", i * 0.005, i * 0.005 * DEG_PER_S);
    for (int i = 0; i < 40 * 50; i++)
        fprintf(probes, "%.3f,%.9f,0,0,1,0,0,0,1\n", i * 0.02, i * 0.02 * MM_PER_S);
    assert_int_equal(fclose(joints), 0);
    assert_int_equal(fclose(probes), 0);
}

static struct runner *start_two(const char *joint_path, const char *probe_path) {
    const struct device_option of_joint[] = {{"driver", "recorded"}, {"file", joint_path}};
    const struct device_option of_probe[] = {
        {"driver", "recorded"}, {"file", probe_path}, {"delay_ms", "40"}};
    const struct device_config configs[] = {{"joint", of_joint, 2}, {"tracker", of_probe, 3}};
    struct runner *runner = NULL;
    struct error err = {{0}};
    if (runner_create(configs, 2, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return runner;
}

static void write_scope(char path[FOLDER_MAX + 16], double hz) {
    snprintf(path, FOLDER_MAX + 16, "%s/scope.csv", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs("t_seconds,scope_tx_mm,scope_ty_mm,scope_tz_mm,scope_qw,scope_qx,scope_qy,scope_qz,"
          "scope_valid\n",
          file);
    for (int i = 0; i < 40 * hz; i++)
        fprintf(file, "%.6f,%.9f,0,0,1,0,0,0,1\n", i / hz, i / hz * MM_PER_S);
    assert_int_equal(fclose(file), 0);
}

// A tracker of 8 Hz beside one of 50 Hz: the joint and the probe are of one time, and no older than
// without it.
static void a_slow_source_holds_no_other_back(void **state) {
    (void)state;
    char joint_path[FOLDER_MAX + 16], probe_path[FOLDER_MAX + 16], scope_path[FOLDER_MAX + 16];
    write_motions(joint_path, probe_path);
    write_scope(scope_path, 8);
    const struct device_option of_joint[] = {{"driver", "recorded"}, {"file", joint_path}};
    const struct device_option of_probe[] = {{"driver", "recorded"}, {"file", probe_path}};
    const struct device_option of_scope[] = {{"driver", "recorded"}, {"file", scope_path}};
    const struct device_config configs[] = {
        {"joint", of_joint, 2}, {"tracker", of_probe, 2}, {"slow", of_scope, 2}};
    struct runner *runner = NULL;
    struct error err = {{0}};
    assert_ok(runner_create(configs, 3, &runner, &err));
    int together = 0, frames = 0, times = 0;
    int64_t last_ns = 0;
    for (int64_t start_ns = clock_now_ns(); clock_now_ns() - start_ns < 2 * NS_PER_S;
         usleep(2000)) {
        struct frame frame = {.number = 1, .time_ns = clock_now_ns()};
        runner_collect(runner, frame.time_ns, &frame);
        if (clock_now_ns() - start_ns < NS_PER_S || frame.count < 3)
            continue; // the paces are not known yet
        frames++;
        together += frame.samples[0].time_ns == frame.samples[1].time_ns;
        times += frame.samples[1].time_ns != last_ns;
        last_ns = frame.samples[1].time_ns;
    }
    runner_destroy(&runner);
    assert_true(together > frames * 9 / 10);
    assert_true(times > 25); // not 8
}

// Each value tells the time at which it was measured: the same offset in every frame.
static void the_joint_is_taken_at_the_trackers_time(void **state) {
    (void)state;
    char joint_path[FOLDER_MAX + 16], probe_path[FOLDER_MAX + 16];
    write_motions(joint_path, probe_path);
    struct runner *runner = start_two(joint_path, probe_path);
    double joint_offset = 0, probe_offset = 0;
    for (int seen = 0; seen < 200; usleep(1000)) {
        struct frame frame = {.number = 1, .time_ns = clock_now_ns()};
        runner_collect(runner, frame.time_ns, &frame);
        assert_int_equal(frame.count, 2);
        const struct sample *of_joint = &frame.samples[0], *of_probe = &frame.samples[1];
        if (of_joint->validity != VALIDITY_OK || of_probe->validity != VALIDITY_OK)
            seen = 0;    // a busy machine made one of them silent
        if (seen++ < 80) // the joint has a past that reaches back so far
            continue;
        assert_int_equal(of_joint->time_ns, of_probe->time_ns);
        assert_true(frame.time_ns - of_probe->time_ns >= DELAY_MS * NS_PER_MS);
        double seconds = (double)of_joint->time_ns / NS_PER_S;
        double joint_now = of_joint->joint.flexion_deg - seconds * DEG_PER_S;
        double probe_now = of_probe->T_mockup_body.translation.x - seconds * MM_PER_S;
        if (seen == 81)
            joint_offset = joint_now, probe_offset = probe_now;
        assert_near(joint_now, joint_offset, 1e-3);
        assert_near(probe_now, probe_offset, 1e-3);
        assert_true(runner_alignment_ms(runner) > 0);
    }
    runner_destroy(&runner);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(between_two_samples_it_is_between_them),
        cmocka_unit_test(past_its_ends_it_stays_and_says_when_it_was),
        cmocka_unit_test(a_force_is_of_the_time_of_the_poses),
        cmocka_unit_test(a_press_has_its_own_time),
        cmocka_unit_test(a_pose_turns_halfway),
        cmocka_unit_test(a_fast_source_keeps_more_than_a_second),
        cmocka_unit_test(the_joint_is_taken_at_the_trackers_time),
        cmocka_unit_test(a_slow_source_holds_no_other_back),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
