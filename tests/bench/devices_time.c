// Time: trackers that are late by unknown times, with jitter, are calibrated as a technician does
// it. Then the joint bends at 60 degrees a second with the probe fixed to the bone: how far do the
// two differ in what the station sends?
#include "base/check.h"
#include "base/clock.h"
#include "calibrate/delay.h"
#include "devices.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

enum { DELAYS = 10, LANES = DELAYS + 1, SAMPLES_MAX = 20000 };

static const double least_ms = 15, most_ms = 50, jitter_ms = 20, tracker_hz = 60, joint_hz = 500;
static const double settle_s = 3; // until the offset of the tracker's clock is known

// The last lane has the tracker of the one before it, without its stamps.
struct lane {
    struct mockup *mockup;
    struct runner *runner;
    bool stamped;
    double true_ms, error_sum; // of squares
    int looks, frames;         // `frames`: of them with joint and tool
    struct delay_fit fit;
    int flexion_count, turn_count;
    struct delay_flexion flexions[SAMPLES_MAX];
    struct delay_turn turns[SAMPLES_MAX];
};

static double delay_of(int i) {
    return least_ms + i * (most_ms - least_ms) / (DELAYS - 1);
}

static enum result start_mockup(int i, struct mockup *out, struct error *err) {
    char faults[256];
    snprintf(faults, sizeof faults,
             "[fault late]\nwho = tracker\nwhat = late\nat_s = 0\nfor_s = 10000\nvalue = %g\n"
             "[fault jitter]\nwho = tracker\nwhat = jitter\nat_s = 0\nfor_s = 10000\nvalue = %g\n",
             delay_of(i), jitter_ms);
    return mockup_start_bending(faults, tracker_hz, out, err);
}

static enum result open_lane(struct lane *lane, double delay_ms, struct error *err) {
    char joint[16], delay[32];
    const struct device_option encoders[] = {{"driver", "modbus"},
                                             {"address", lane->mockup->modbus_tcp},
                                             {"rate_hz", joint},
                                             {"flexion", "12 1 0 f32"}};
    const struct device_option tracker[] = {{"driver", "tracker"},
                                            {"address", lane->mockup->tracker},
                                            {"tool.probe", "probe"},
                                            {"delay_ms", delay},
                                            {"stamps", lane->stamped ? "yes" : "no"}};
    const struct device_config configs[] = {{"encoders", encoders, 4}, {"tracker", tracker, 5}};
    snprintf(joint, sizeof joint, "%g", joint_hz);
    snprintf(delay, sizeof delay, "%.3f", delay_ms);
    return runner_create(configs, 2, &lane->runner, err);
}

// ---- the calibration ----------------------------------------------------------------------------

static void record(struct lane *lane) {
    struct frame frame = {.count = 0};
    runner_newest(lane->runner, clock_now_ns(), &frame);
    const struct sample *joint = &frame.samples[0], *probe = &frame.samples[1];
    int f = lane->flexion_count, t = lane->turn_count;
    if (joint->validity == VALIDITY_OK && f < SAMPLES_MAX &&
        (!f || joint->time_ns > lane->flexions[f - 1].time_ns))
        lane->flexions[lane->flexion_count++] =
            (struct delay_flexion){joint->time_ns, joint->joint.flexion_deg};
    if (probe->validity == VALIDITY_OK && t < SAMPLES_MAX &&
        (!t || probe->time_ns > lane->turns[t - 1].time_ns))
        lane->turns[lane->turn_count++] =
            (struct delay_turn){probe->time_ns, probe->T_mockup_body.rotation};
}

static void each_ms(struct lane *lanes, double seconds, void (*act)(struct lane *lane)) {
    int64_t start_ns = clock_now_ns();
    for (int ms = 1; ms <= 1e3 * seconds; ms++) {
        sleep_until(start_ns + ms * NS_PER_MS);
        for (int i = 0; i < LANES && act; i++)
            act(&lanes[i]);
    }
}

static enum result calibrate(struct lane *lanes, double seconds, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < LANES && result == RESULT_OK; i++)
        result = open_lane(&lanes[i], 0, err);
    if (result == RESULT_OK) {
        each_ms(lanes, settle_s, NULL);
        each_ms(lanes, seconds, record);
    }
    for (int i = 0; i < LANES; i++) {
        struct lane *lane = &lanes[i];
        runner_destroy(&lane->runner);
        if (result == RESULT_OK)
            result = delay_calibrate(lane->flexions, lane->flexion_count, lane->turns,
                                     lane->turn_count, &lane->fit, err);
    }
    return result;
}

// ---- bone and tool ------------------------------------------------------------------------------

static void compare(struct lane *lane) {
    struct frame frame = {.count = 0};
    runner_collect(lane->runner, clock_now_ns(), &frame);
    lane->looks++;
    const struct sample *joint = &frame.samples[0], *probe = &frame.samples[1];
    if (joint->validity != VALIDITY_OK || probe->validity != VALIDITY_OK)
        return;
    quat q = probe->T_mockup_body.rotation;
    double off = 2 * atan2(q.x, q.w) * 180 / M_PI - joint->joint.flexion_deg;
    lane->error_sum += off * off;
    lane->frames++;
}

static enum result use(struct lane *lanes, double seconds, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < LANES && result == RESULT_OK; i++)
        result = open_lane(&lanes[i], fmax(0, lanes[i].fit.delay_ms), err);
    if (result == RESULT_OK) {
        each_ms(lanes, settle_s, NULL);
        each_ms(lanes, seconds, compare);
    }
    for (int i = 0; i < LANES; i++)
        runner_destroy(&lanes[i].runner);
    return result;
}

static double error_of(const struct lane *lane) {
    return lane->frames ? sqrt(lane->error_sum / lane->frames) : INFINITY;
}

static void report_all(const struct lane *lanes, struct report *report) {
    double worst_ms = 0, worst_deg = 0, least_share = 1;
    for (int i = 0; i < DELAYS; i++) {
        double off_ms = lanes[i].fit.delay_ms - lanes[i].true_ms;
        report_figure(report, off_ms, "ms", "delay %.1f ms/error", lanes[i].true_ms);
        report_figure(report, lanes[i].fit.residual_deg, "degrees", "delay %.1f ms/residual",
                      lanes[i].true_ms);
        report_figure(report, error_of(&lanes[i]), "degrees", "delay %.1f ms/tool to bone",
                      lanes[i].true_ms);
        worst_ms = fmax(worst_ms, fabs(off_ms));
        worst_deg = fmax(worst_deg, error_of(&lanes[i]));
        least_share = fmin(least_share, lanes[i].frames / (double)lanes[i].looks);
    }
    report_mark(report, "delay_error_ms_max", worst_ms, "ms", 1, BETTER_LOW);
    report_mark(report, "tool_to_bone_error_deg_60", worst_deg, "degrees", 0.1, BETTER_LOW);
    report_mark(report, "tool_to_bone_compared_share", least_share, "1", 0.9, BETTER_HIGH);
    report_figure(report, error_of(&lanes[DELAYS]), "degrees",
                  "tool_to_bone_error_deg_60_unstamped");
}

// ---- beside another part ------------------------------------------------------------------------

struct bench_time {
    pthread_t thread;
    bool quick;
    enum result result;
    struct error err;
    int started;
    struct mockup mockups[DELAYS];
    struct lane lanes[LANES];
};

static enum result run(struct bench_time *b) {
    double seconds = b->quick ? 8 : 20;
    for (int i = 0; i < DELAYS; i++) {
        enum result result = start_mockup(i, &b->mockups[i], &b->err);
        if (result != RESULT_OK)
            return result;
        b->started++;
    }
    for (int i = 0; i < LANES; i++) {
        int of = i < DELAYS ? i : DELAYS - 1;
        b->lanes[i].mockup = &b->mockups[of];
        b->lanes[i].stamped = i < DELAYS;
        b->lanes[i].true_ms = delay_of(of);
    }
    enum result result = calibrate(b->lanes, seconds, &b->err);
    return result == RESULT_OK ? use(b->lanes, seconds, &b->err) : result;
}

static void *run_thread(void *argument) {
    struct bench_time *b = argument;
    b->result = run(b);
    return NULL;
}

struct bench_time *bench_time_start(bool quick) {
    struct bench_time *b = alloc(1, sizeof *b);
    b->quick = quick;
    CHECK(pthread_create(&b->thread, NULL, run_thread, b) == 0);
    return b;
}

enum result bench_time_end(struct bench_time **time, struct report *report, struct error *err) {
    struct bench_time *b = *time;
    pthread_join(b->thread, NULL);
    enum result result = b->result;
    if (result == RESULT_OK)
        report_all(b->lanes, report);
    else
        *err = b->err;
    for (int i = 0; i < b->started; i++)
        mockup_end(&b->mockups[i]);
    free(b);
    *time = NULL;
    return result;
}
