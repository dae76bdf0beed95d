// Which values a station trusts: sources that shake, and messages that are late.

#include "base/clock.h"
#include "drivers/stamp.h"
#include "random.h"
#include "samples/slot.h"
#include "test.h"

// ---- noise --------------------------------------------------------------------------------------

// Share of the poses of a hand with noise of `sigma` that a slot does not use.
static double share_refused(double sigma, int64_t period_ms, double amplitude, double hz) {
    struct slot slot;
    slot_init(&slot, CHANNEL_PROBE, SAMPLE_POSE, 0, 100, 50);
    struct random random = {9};
    int refused = 0, count = 2000;
    for (int i = 1; i <= count; i++) {
        int64_t ms = i * period_ms;
        double t = (double)ms / 1000, x = amplitude * sin(2 * M_PI * hz * t);
        struct sample s = {
            .channel = CHANNEL_PROBE, .kind = SAMPLE_POSE, .time_ns = ms * NS_PER_MS};
        s.T_mockup_body = pose_identity();
        s.T_mockup_body.translation.x = x + sigma * random_normal(&random);
        s.T_mockup_body.translation.y = sigma * random_normal(&random);
        s.T_mockup_body.translation.z = sigma * random_normal(&random);
        refused += slot_take(&slot, &s, s.time_ns) == SLOT_NOISY;
    }
    return refused / (double)count;
}

static void noise_beyond_a_hands_motion_is_refused_and_a_hand_is_not(void **state) {
    (void)state;
    static const int64_t periods_ms[] = {5, 10, 20, 50};
    for (int i = 0; i < 4; i++) {
        assert_near(share_refused(0.3, periods_ms[i], 0, 0), 0, 0);
        assert_near(share_refused(0.3, periods_ms[i], 150, 1), 0, 0); // 0.9 m/s
        assert_near(share_refused(0.3, periods_ms[i], 2, 8), 0, 0);   // a tremor
        assert_near(share_refused(1.0, periods_ms[i], 100, 0.5), 0, 0);
    }
    assert_true(share_refused(8, 10, 0, 0) > 0.95);
    assert_true(share_refused(8, 5, 100, 0.5) > 0.95);
}

// ---- time stamps --------------------------------------------------------------------------------

struct verdicts {
    int good, late, ahead, anew;
};

// A second at 100 messages, whose stamps and arrivals are off from what they should be.
static struct verdicts judged(struct stamp_clock *clock, int second, double stamp_off_s,
                              double arrival_off_s) {
    struct verdicts v = {0};
    for (int i = 0; i < 100; i++) {
        double t = second + 0.01 * i, utc = 1.7e9 + t + stamp_off_s;
        switch (
            stamp_judge(clock, (int64_t)(utc * 1e9), (int64_t)((5 + t + arrival_off_s) * 1e9))) {
        case STAMP_GOOD:
            v.good++;
            break;
        case STAMP_LATE:
            v.late++;
            break;
        case STAMP_AHEAD:
            v.ahead++;
            break;
        case STAMP_ANEW:
            v.anew++;
            break;
        }
    }
    return v;
}

static void late_messages_are_told_from_good_ones(void **state) {
    (void)state;
    struct stamp_clock clock = {0};
    assert_int_equal(100, judged(&clock, 0, 0, 0.02).good);
    assert_int_equal(100, judged(&clock, 1, 0, 0).good); // quicker than ever
    assert_int_equal(100, judged(&clock, 2, 0, 0.09).good);
    assert_int_equal(100, judged(&clock, 3, 0, 0.3).late);
    assert_int_equal(100, judged(&clock, 4, 0, 0).good);
}

static void a_clock_that_steps_is_noticed_and_lived_with(void **state) {
    (void)state;
    struct stamp_clock clock = {0};
    assert_int_equal(100, judged(&clock, 0, 0, 0).good);
    struct verdicts forward = judged(&clock, 1, 3, 0);
    assert_int_equal(1, forward.ahead);
    assert_int_equal(99, forward.good);
    assert_int_equal(100, judged(&clock, 2, 0, 0).late);
    struct verdicts back = judged(&clock, 3, 0, 0);
    assert_int_equal(1, back.anew);
    assert_int_equal(100, back.late + back.anew + back.good);
    assert_true(back.good > 40);
    assert_int_equal(100, judged(&clock, 4, 0, 0).good);
}

static void a_clock_that_drifts_a_little_is_no_trouble(void **state) {
    (void)state;
    struct stamp_clock slow = {0}, fast = {0};
    for (int s = 0; s < 1000; s++) {
        assert_int_equal(100, judged(&slow, s, -4e-4 * s, 0).good);
        assert_true(judged(&fast, s, 4e-4 * s, 0).good >= 99);
    }
}

// At 60 Hz a message is 15 to 50 ms on its way; after some seconds its time is known to 1 ms.
static void jitter_and_drift_leave_the_time_of_a_measurement(void **state) {
    (void)state;
    static const double drifts[] = {-1e-4, 0, 2e-5, 3e-4};
    for (size_t k = 0; k < sizeof drifts / sizeof *drifts; k++) {
        struct stamp_clock clock = {0};
        struct random random = {11 + k};
        double arrival = 0, worst = 0;
        int64_t last_ns = 0;
        for (int i = 0; i < 100 * 60; i++) {
            double t = 10 + i / 60.0, utc = 1.7e9 + t * (1 + drifts[k]);
            arrival = fmax(arrival, t + random_between(&random, 0.015, 0.05));
            int64_t stamp_ns = (int64_t)(utc * 1e9), arrival_ns = (int64_t)(arrival * 1e9);
            if (stamp_judge(&clock, stamp_ns, arrival_ns) != STAMP_GOOD)
                fail_msg("drift %g: message %d is not good", drifts[k], i);
            int64_t time_ns = stamp_time(&clock, stamp_ns, arrival_ns);
            assert_true(time_ns > last_ns && time_ns <= arrival_ns);
            last_ns = time_ns;
            if (i > 20 * 60)
                worst = fmax(worst, fabs((double)time_ns / 1e9 - (t + 0.015)));
        }
        if (!(worst < 1e-3))
            fail_msg("drift %g: off by %.2f ms", drifts[k], 1e3 * worst);
    }
}

static void a_clock_that_is_set_back_a_little_begins_anew(void **state) {
    (void)state;
    struct stamp_clock clock = {0};
    int64_t last_ns = 0;
    for (int i = 0; i < 2000; i++) {
        int64_t arrival_ns = i * 10 * NS_PER_MS,
                stamp_ns = arrival_ns - (i < 1000 ? 0 : 50) * NS_PER_MS;
        assert_int_equal(stamp_judge(&clock, stamp_ns, arrival_ns), STAMP_GOOD);
        int64_t time_ns = stamp_time(&clock, stamp_ns, arrival_ns);
        assert_true(!i || time_ns > last_ns);
        assert_int_equal(time_ns, arrival_ns);
        last_ns = time_ns;
    }
}

// Of a minute of messages at 60 Hz: is the stamp found to be no clock?
static bool is_found_out(double (*stamp_s)(double t, struct random *random), double jitter_s) {
    struct random random = {5};
    struct stamp_clock clock = {0};
    struct stamp_trial trial = {0};
    double arrival = 0;
    for (int i = 0; i < 60 * 60; i++) {
        double t = 10 + i / 60.0;
        arrival = fmax(arrival, t + random_between(&random, 0, jitter_s));
        int64_t arrival_ns = (int64_t)(arrival * 1e9);
        enum stamp_verdict verdict =
            stamp_judge(&clock, (int64_t)(1e9 * (1.7e9 + stamp_s(t, &random))), arrival_ns);
        if (stamp_is_no_clock(&trial, verdict, arrival_ns))
            return true;
    }
    return false;
}

static double right(double t, struct random *random) {
    (void)random;
    return t;
}

static double nanoseconds_for_a_fraction(double t, struct random *random) {
    (void)random;
    return floor(t) + (t - floor(t)) * 1e9 / 4294967296.0;
}

static double half_as_fast(double t, struct random *random) {
    (void)random;
    return t / 2;
}

static double a_stall(double t, struct random *random) { // of the network, 300 ms
    (void)random;
    return t > 30 && t < 33 ? t - 0.3 : t;
}

static double set_at; // when the clock is set back

static double set_back(double t, struct random *random) {
    (void)random;
    return t > set_at ? t - 3 : t;
}

static double anything(double t, struct random *random) {
    (void)t;
    return random_between(random, -1e6, 1e6);
}

static void stamps_that_are_no_clock_are_found_out(void **state) {
    (void)state;
    assert_true(is_found_out(nanoseconds_for_a_fraction, 0.02));
    assert_true(is_found_out(half_as_fast, 0.02));
    assert_true(is_found_out(anything, 0.02));
    assert_false(is_found_out(right, 0.02));
    assert_false(is_found_out(right, 0.3));
    assert_false(is_found_out(a_stall, 0.02));
    for (set_at = 30; set_at < 33.2; set_at += 1 / 60.0)
        assert_false(is_found_out(set_back, 0.02));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_beyond_a_hands_motion_is_refused_and_a_hand_is_not),
        cmocka_unit_test(late_messages_are_told_from_good_ones),
        cmocka_unit_test(a_clock_that_steps_is_noticed_and_lived_with),
        cmocka_unit_test(a_clock_that_drifts_a_little_is_no_trouble),
        cmocka_unit_test(jitter_and_drift_leave_the_time_of_a_measurement),
        cmocka_unit_test(a_clock_that_is_set_back_a_little_begins_anew),
        cmocka_unit_test(stamps_that_are_no_clock_are_found_out),
    };
    return cmocka_run_group_tests_name("device_trust", tests, NULL, NULL);
}
