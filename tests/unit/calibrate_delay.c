// The delay between tracker and joint against delays made up in the test.
#include "base/clock.h"
#include "calibrate/delay.h"
#include "random.h"
#include "test.h"

#include <string.h>

#define SECONDS 20

// A hand that bends a knee: some sines, of no common period.
struct hand {
    double middle_deg, deg[3], hz[3], phase[3];
};

static struct hand hand_of(struct random *r, double deg, double hz) {
    struct hand hand = {.middle_deg = random_between(r, 20, 60)};
    for (int i = 0; i < 3; i++) {
        hand.deg[i] = deg / (i + 1);
        hand.hz[i] = hz * (i + 1) * random_between(r, 0.8, 1.2);
        hand.phase[i] = random_between(r, 0, 6);
    }
    return hand;
}

static double flexion_of(const struct hand *hand, double t) {
    double deg = hand->middle_deg;
    for (int i = 0; i < 3; i++)
        deg += hand->deg[i] * sin(2 * M_PI * hand->hz[i] * t + hand->phase[i]);
    return deg;
}

// A knee turns inward a little as it bends, and the axis is no axis of the tracker.
static quat turn_of(double flexion_deg, quat tracker, quat tool, vec3 tremor_rad) {
    quat bend = quat_from_axis_angle((vec3){1, 0, 0}, flexion_deg * RAD_PER_DEG);
    quat inward = quat_from_axis_angle((vec3){0, 0, 1}, 0.15 * flexion_deg * RAD_PER_DEG);
    quat shaken = quat_multiply(quat_multiply(bend, inward), tool);
    double angle = vec3_length(tremor_rad);
    if (angle > 0)
        shaken =
            quat_multiply(shaken, quat_from_axis_angle(vec3_scale(1 / angle, tremor_rad), angle));
    return quat_multiply(tracker, shaken);
}

struct recorded {
    int flexion_count, turn_count;
    struct delay_flexion flexions[SECONDS * 1000];
    struct delay_turn turns[SECONDS * 500];
};

static void record(struct random *r, const struct hand *hand, double joint_hz, double tracker_hz,
                   double delay_ms, double noise_deg, struct recorded *out) {
    quat tracker = random_pose(r, 1).rotation, tool = random_pose(r, 1).rotation;
    out->flexion_count = (int)(SECONDS * joint_hz);
    out->turn_count = (int)(SECONDS * tracker_hz);
    for (int i = 0; i < out->flexion_count; i++) {
        double t = i / joint_hz;
        out->flexions[i] = (struct delay_flexion){(int64_t)(t * 1e9), flexion_of(hand, t)};
    }
    for (int i = 0; i < out->turn_count; i++) {
        double t = 0.003 + i / tracker_hz, noise = noise_deg * RAD_PER_DEG;
        vec3 tremor = {noise * random_normal(r), noise * random_normal(r),
                       noise * random_normal(r)};
        out->turns[i] = (struct delay_turn){(int64_t)((t + delay_ms / 1e3) * 1e9),
                                            turn_of(flexion_of(hand, t), tracker, tool, tremor)};
    }
}

static struct recorded recording;

static enum result measure(struct delay_fit *out, struct error *err) {
    return delay_calibrate(recording.flexions, recording.flexion_count, recording.turns,
                           recording.turn_count, out, err);
}

static void a_delay_is_found_to_a_millisecond(void **state) {
    (void)state;
    static const double delays_ms[] = {-40, 0, 3.4, 15, 22.7, 31.2, 40, 50, 83.3, 240};
    struct random r = {4};
    for (size_t i = 0; i < sizeof delays_ms / sizeof *delays_ms; i++)
        for (int hz = 20; hz <= 500; hz *= 5) {
            struct hand hand = hand_of(&r, 15, random_between(&r, 0.4, 0.8));
            struct delay_fit fit;
            struct error err = {{0}};
            record(&r, &hand, 100, hz, delays_ms[i], 0.2, &recording);
            if (measure(&fit, &err) != RESULT_OK)
                fail_msg("%g ms, %d Hz: %s", delays_ms[i], hz, err.text);
            assert_near(fit.delay_ms, delays_ms[i], 1);
            assert_near(fit.delay_ms, delays_ms[i], 5 * fit.uncertainty_ms + 0.2);
            assert_true(fit.residual_deg < 1);
        }
}

struct refused {
    double deg, hz, delay_ms, noise_deg;
    const char *says;
};

static void a_motion_that_cannot_tell_is_refused(void **state) {
    (void)state;
    static const struct refused rows[] = {
        {0, 0.3, 20, 0.2, "too little"},    {15, 0.005, 20, 0.2, "too little"},
        {2, 0.5, 20, 0.1, "too little"},    {15, 0.3, 20, 40, "does not turn as the joint bends"},
        {15, 0.3, 320, 0.2, "not between"},
    };
    struct random r = {5};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hand hand = hand_of(&r, rows[i].deg, rows[i].hz);
        struct delay_fit fit;
        struct error err = {{0}};
        record(&r, &hand, 100, 60, rows[i].delay_ms, rows[i].noise_deg, &recording);
        assert_int_equal(measure(&fit, &err), RESULT_INVALID);
        if (!strstr(err.text, rows[i].says))
            fail_msg("row %zu: \"%s\" does not say \"%s\"", i, err.text, rows[i].says);
    }
}

static void a_tool_that_another_hand_moves_is_refused(void **state) {
    (void)state;
    struct random r = {6};
    struct hand hand = hand_of(&r, 15, 0.3), other = hand_of(&r, 15, 0.4);
    static struct recorded another;
    struct delay_fit fit;
    struct error err = {{0}};
    record(&r, &hand, 100, 60, 20, 0.2, &recording);
    record(&r, &other, 100, 60, 20, 0.2, &another);
    memcpy(recording.turns, another.turns, sizeof recording.turns);
    assert_int_equal(measure(&fit, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "Fix it to the bone"));
}

static void too_few_samples_are_refused(void **state) {
    (void)state;
    struct random r = {7};
    struct hand hand = hand_of(&r, 15, 0.3);
    struct delay_fit fit;
    record(&r, &hand, 100, 60, 20, 0.2, &recording);
    recording.turn_count = 60;
    assert_int_equal(measure(&fit, NULL), RESULT_MISSING);
    recording.turn_count = 0;
    assert_int_equal(measure(&fit, NULL), RESULT_MISSING);
    recording.flexion_count = 1;
    assert_int_equal(measure(&fit, NULL), RESULT_MISSING);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_delay_is_found_to_a_millisecond),
        cmocka_unit_test(a_motion_that_cannot_tell_is_refused),
        cmocka_unit_test(a_tool_that_another_hand_moves_is_refused),
        cmocka_unit_test(too_few_samples_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
