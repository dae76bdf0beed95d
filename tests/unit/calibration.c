// How a calibration is judged, and the drift of touches.
#include "runtime/drift.h"
#include "sessions/calibration.h"

#include "random.h"
#include "test.h"

#include <string.h>

#define DAY_S 86400

static void a_calibration_is_warned_of_beyond_each_limit_and_only_there(void **state) {
    (void)state;
    static const struct {
        double days, mm, deg;
        const char *word; // NULL: good
    } rows[] = {
        {0, 0, 0, NULL},         {30.5, 0.5, 0.5, NULL}, {31, 0, 0, "days"}, {4000, 0, 0, "days"},
        {-0.5, 0, 0, NULL},      {-2, 0, 0, "to come"},  {1, 1.01, 0, "mm"}, {1, 1, 1, NULL},
        {1, 0, 1.01, "degrees"}, {1, 1e300, 0, "mm"},
    };
    static struct sessions_config config = {
        .calibration_days = 30, .calibration_mm = 1, .calibration_deg = 1};
    int64_t now_s = 1800000000;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        arthron_Calibration c = {now_s - (int64_t)(rows[i].days * DAY_S), rows[i].mm, rows[i].deg};
        char text[128];
        calibration_judge(&c, &config, now_s, text, sizeof text);
        if (rows[i].word ? !strstr(text, rows[i].word) : text[0])
            fail_msg("row %zu: \"%s\"", i, text);
    }
}

static bool touch(struct drift *drift, int steps, double distance_mm) {
    for (int i = 0; i < steps; i++)
        assert_false(drift_step(drift, true, distance_mm));
    return drift_step(drift, false, 50);
}

static void a_touch_counts_once_however_long_it_is(void **state) {
    (void)state;
    struct drift drift = {0};
    assert_true(touch(&drift, 1, 3));
    assert_true(touch(&drift, 500, 1));
    assert_int_equal(drift.touches, 2);
    assert_near(drift.mean_mm, 2, 1e-12);
    assert_false(touch(&drift, 0, 9));
    assert_int_equal(drift.touches, 2);
}

static void steps_without_a_pose_do_not_count(void **state) {
    (void)state;
    struct drift drift = {0};
    assert_false(touch(&drift, 20, -1));
    assert_int_equal(drift.touches, 0);
    drift_step(&drift, true, -1);
    drift_step(&drift, true, 2);
    drift_step(&drift, true, -1);
    assert_true(drift_step(&drift, false, 0));
    assert_near(drift.mean_mm, 2, 1e-12);
}

static void the_mean_follows_a_slip_and_forgets_what_was(void **state) {
    (void)state;
    struct random r = {1};
    struct drift drift = {0};
    for (int i = 0; i < 200; i++)
        touch(&drift, 3, random_between(&r, 0, 0.2));
    assert_near(drift.mean_mm, 0.1, 0.05);
    for (int i = 0; i < DRIFT_TOUCHES; i++)
        touch(&drift, 3, 5);
    assert_true(drift.mean_mm > 2.5 && drift.mean_mm < 5);
    for (int i = 0; i < 10 * DRIFT_TOUCHES; i++)
        touch(&drift, 3, 5);
    assert_near(drift.mean_mm, 5, 0.01);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_calibration_is_warned_of_beyond_each_limit_and_only_there),
        cmocka_unit_test(a_touch_counts_once_however_long_it_is),
        cmocka_unit_test(steps_without_a_pose_do_not_count),
        cmocka_unit_test(the_mean_follows_a_slip_and_forgets_what_was),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
