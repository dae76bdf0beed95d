// Smoothed positions, paths, jerk and both hands, against closed forms and brute force.

#include "metrics/hands.h"
#include "metrics/travel.h"
#include "random.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

#define NS 1e9

static const double edges_s = 0.42; // that each run gives less than it lasted

struct meter {
    struct smooth smooth;
    struct travel travel;
};

static struct meter fresh(void) {
    struct meter m;
    smooth_init(&m.smooth);
    travel_init(&m.travel);
    return m;
}

static void feed(struct meter *m, double t, vec3 p) {
    struct smooth_point points[SMOOTH_OUT_MAX];
    int count = smooth_feed(&m->smooth, (int64_t)(t * NS + 0.5), p, points);
    assert_in_range(count, 0, SMOOTH_OUT_MAX);
    for (int i = 0; i < count; i++)
        travel_add(&m->travel, &points[i]);
}

typedef vec3 motion(double t);

static double ldlj(struct meter m) {
    return travel_ldlj(&m.travel);
}

// Samples of a motion, from 0 to `seconds`, at a mean rate; times jitter by a part of the period.
static struct meter measured(motion *at, double seconds, double rate, double jitter) {
    struct meter m = fresh();
    struct random r = {7};
    for (int i = 0; i <= (int)(seconds * rate); i++) {
        double t = i == 0 ? 0 : (i + random_between(&r, -0.5, 0.5) * jitter) / rate;
        feed(&m, t, at(t));
    }
    return m;
}

// ---- the filter ---------------------------------------------------------------------------------

static const struct wave {
    double mm, hz, phase;
    vec3 along;
} waves[] = {
    {12, 0.3, 0.1, {1, 0.2, 0}},
    {6, 0.9, 1, {0, 1, -0.5}},
    {2, 2.3, 2, {0.3, 0, 1}},
    {0.5, 6, 0.5, {1, 1, 1}},
};
#define WAVE_COUNT (sizeof waves / sizeof *waves)

// With the k-th wave's amplitude times gain[k].
static vec3 sum_of_waves(double t, const double *gain) {
    vec3 p = {100, -50, 20};
    for (size_t k = 0; k < WAVE_COUNT; k++)
        p = vec3_add_scaled(p,
                            (gain ? gain[k] : 1) * waves[k].mm *
                                sin(2 * M_PI * waves[k].hz * t + waves[k].phase),
                            waves[k].along);
    return p;
}

static vec3 hand(double t) {
    return sum_of_waves(t, NULL);
}

// A mean over 10 ms, then six over eight cells each.
static double response(double hz) {
    double cell = M_PI * hz * 0.01, box = sin(8 * cell) / (8 * sin(cell));
    return sin(cell) / cell * pow(box, 6);
}

static void the_filter_has_the_response_that_its_header_states(void **state) {
    (void)state;
    double gain[WAVE_COUNT];
    for (size_t k = 0; k < WAVE_COUNT; k++)
        gain[k] = response(waves[k].hz);
    struct smooth smooth;
    struct smooth_point points[SMOOTH_OUT_MAX];
    int64_t expected_cell = SMOOTH_TAPS / 2;
    smooth_init(&smooth);
    for (int i = 0; i < 4000; i++) {
        double t = i * 1e-3;
        int count = smooth_feed(&smooth, i * 1000000LL, hand(t), points);
        for (int k = 0; k < count; k++) {
            assert_int_equal(points[k].cell, expected_cell);
            assert_int_equal(points[k].first, expected_cell == SMOOTH_TAPS / 2);
            double middle = 0.01 * ((double)points[k].cell + 0.5);
            assert_vec3_near(points[k].position, sum_of_waves(middle, gain), 1e-3);
            expected_cell++;
        }
    }
    assert_int_equal(expected_cell, 399 - SMOOTH_TAPS / 2);
    assert_near(20 * log10(response(2.34)), -3.0103, 0.05);
    for (double hz = 10; hz < 50; hz += 0.1)
        assert_true(fabs(response(hz)) < 1e-3);
}

static void samples_that_are_not_newer_change_nothing(void **state) {
    (void)state;
    struct meter m = measured(hand, 1, 100, 0), before = m;
    feed(&m, 1, (vec3){1, 2, 3});
    feed(&m, 0.5, (vec3){1, 2, 3});
    assert_memory_equal(&m, &before, sizeof m);
}

static void a_run_may_begin_within_a_cell(void **state) {
    (void)state;
    struct smooth smooth;
    struct smooth_point points[SMOOTH_OUT_MAX];
    int64_t next = SMOOTH_TAPS / 2 + 1;
    smooth_init(&smooth);
    for (int i = 0; i < 100; i++) {
        int count = smooth_feed(&smooth, 3000000 + i * 7000000LL, (vec3){100, 200, -50}, points);
        for (int k = 0; k < count; k++) {
            assert_int_equal(points[k].cell, next++);
            assert_vec3_near(points[k].position, ((vec3){100, 200, -50}), 1e-9);
        }
    }
    assert_true(next > SMOOTH_TAPS / 2 + 10);
}

static void a_gap_is_bridged_up_to_the_stated_time(void **state) {
    (void)state;
    for (int over = 0; over < 2; over++) {
        struct meter m = fresh();
        double gap = over ? 0.151 : 0.149;
        for (int i = 0; i <= 200; i++)
            feed(&m, 0.01 * i, (vec3){0.1 * i, 0, 0});
        for (int i = 0; i <= 200; i++)
            feed(&m, 2 + gap + 0.01 * i, (vec3){30 + 0.1 * i, 0, 0});
        double lost_s = over ? 2 * edges_s + 0.01 : edges_s;
        assert_near(travel_path_mm(&m.travel), over ? 40 - 10 * lost_s : 50 - 10 * lost_s, 0.3);
        assert_near((double)m.travel.jerks, over ? 2 * (200 - 45) : 400 + 14 - 45, 2);
    }
}

// ---- paths --------------------------------------------------------------------------------------

static vec3 circle(double t) {
    double a = 2 * M_PI * t / 10;
    return (vec3){5 + 20 * cos(a), 7, -3 + 20 * sin(a)};
}

static void a_circle_has_its_length_at_any_rate(void **state) {
    (void)state;
    const struct {
        double rate, jitter;
    } rows[] = {{1000, 0}, {333, 0.5}, {100, 0}, {60, 0.9}, {47, 0.5}, {25, 0.9}, {13, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct meter m = measured(circle, 30, rows[i].rate, rows[i].jitter);
        double seconds = (double)(m.travel.jerks + 2) / SMOOTH_RATE_HZ;
        assert_near(seconds, 30 - edges_s, 0.1);
        double length = 2 * M_PI * 20 / 10 * seconds;
        assert_near(travel_path_mm(&m.travel) / length, 1, 2e-3);
        // A chord of 10 mm is shorter than its arc by 1 %.
        assert_near(travel_economy(&m.travel), 10 / (2 * 20 * asin(10 / 40.0)), 2e-3);
    }
}

static double length_of(const vec3 *points, int count) {
    double length = 0;
    for (int i = 1; i < count; i++)
        length += vec3_distance(points[i], points[i - 1]);
    return length;
}

static void rest_under_noise_is_no_path(void **state) {
    (void)state;
    enum { COUNT = 6000 };
    static vec3 points[COUNT];
    struct random r = {3};
    struct meter m = fresh();
    for (int i = 0; i < COUNT; i++) {
        vec3 noise = {random_normal(&r), random_normal(&r), random_normal(&r)};
        points[i] = vec3_scale(0.1, noise);
        feed(&m, 0.01 * i, points[i]);
    }
    assert_true(length_of(points, COUNT) > 1000);
    assert_true(travel_path_mm(&m.travel) < 1);
}

static void smoothing_never_makes_a_path_longer(void **state) {
    (void)state;
    struct random r = {11};
    for (int round = 0; round < 20; round++) {
        vec3 points[500] = {{0}};
        struct meter m = fresh();
        double step = random_between(&r, 0.01, 5);
        for (int i = 1; i < 500; i++)
            points[i] = vec3_add(points[i - 1], random_in_box(&r, step));
        for (int i = 0; i < 500; i++)
            feed(&m, 0.013 * i, points[i]);
        assert_true(travel_path_mm(&m.travel) <= length_of(points, 500));
    }
}

// The first place at the ruler's length is looked for in tiny steps.
static double walked(const vec3 *points, int count, double mm) {
    double marked = 0;
    vec3 mark = points[0], here = points[0];
    for (int i = 1; i < count; i++)
        for (int k = 1; k <= 2000; k++) {
            here = vec3_lerp(points[i - 1], points[i], k / 2000.0);
            if (vec3_distance(here, mark) >= mm) {
                mark = here;
                marked += mm;
            }
        }
    return marked + vec3_distance(here, mark);
}

static void a_ruler_walks_as_one_on_foot(void **state) {
    (void)state;
    struct random r = {5};
    for (int round = 0; round < 30; round++) {
        vec3 points[40];
        struct ruler ruler;
        double step = random_between(&r, 0.1, 6);
        ruler_init(&ruler, 1);
        for (int i = 0; i < 40; i++) {
            points[i] = i ? vec3_add(points[i - 1], random_in_box(&r, step)) : (vec3){4, 5, 6};
            ruler_add(&ruler, points[i]);
        }
        double expected = walked(points, 40, 1);
        assert_near(ruler_length(&ruler) / expected, 1, 0.02);
    }
}

// ---- jerk ---------------------------------------------------------------------------------------

static double reach_mm, reach_s, rest_s;

static vec3 reach(double t) {
    double u = fmin(fmax((t - rest_s) / reach_s, 0), 1);
    double way = reach_mm * u * u * u * (10 - 15 * u + 6 * u * u);
    return (vec3){0.6 * way, 3, 0.8 * way};
}

// Of a minimum-jerk reach alone, ∫|j|² = 720 A²/D⁵ and max|v| = 15/8 A/D: the dimensionless jerk is
// 204.8; with rest before and after it grows by the time's third power. Where the reach begins and
// ends its jerk jumps: of that the filter takes a share that falls with the reach's time.
static void a_minimum_jerk_reach_has_the_known_smoothness(void **state) {
    (void)state;
    const struct {
        double mm, seconds, rest, rate;
    } rows[] = {
        {60, 4, 1, 100}, {60, 4, 1, 400}, {200, 4, 1, 100}, {100, 16, 0.5, 60}, {10, 6, 3, 200}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        reach_mm = rows[i].mm;
        reach_s = rows[i].seconds;
        rest_s = rows[i].rest;
        struct meter m = measured(reach, reach_s + 2 * rest_s, rows[i].rate, 0);
        double all = (double)m.travel.jerks / SMOOTH_RATE_HZ;
        assert_near(all, reach_s + 2 * rest_s - edges_s - 0.03, 0.05);
        assert_near(m.travel.largest_speed, 15.0 / 8 * reach_mm / reach_s, 0.01 * reach_mm);
        assert_near(travel_ldlj(&m.travel), -log(204.8 * pow(all / reach_s, 3)), 0.35 / reach_s);
        assert_near(travel_path_mm(&m.travel), reach_mm, 0.01 * reach_mm);
    }
}

static void smoothness_has_no_unit(void **state) {
    (void)state;
    rest_s = 1;
    reach_s = 3;
    reach_mm = 40;
    double once = ldlj(measured(reach, 5, 100, 0));
    reach_mm = 120;
    assert_near(ldlj(measured(reach, 5, 100, 0)), once, 1e-6);
}

// A difference over one cell in place of a derivative.
static double difference(double hz) {
    return sin(M_PI * hz * 0.01) / (M_PI * hz * 0.01);
}

// Σ|j|² of the filtered waves, from their closed form.
static double jerk_of_waves(double seconds) {
    double sum = 0;
    for (int i = 0; i < (int)(seconds * 1000); i++) {
        vec3 j = {0};
        for (size_t k = 0; k < WAVE_COUNT; k++) {
            double w = 2 * M_PI * waves[k].hz, t = 1e-3 * i;
            double third = -pow(w * difference(waves[k].hz), 3) * cos(w * t + waves[k].phase);
            j = vec3_add_scaled(j, response(waves[k].hz) * waves[k].mm * third, waves[k].along);
        }
        sum += vec3_dot(j, j) * 1e-3;
    }
    return sum;
}

static void jerk_is_that_of_the_filtered_motion_at_any_rate(void **state) {
    (void)state;
    double expected = jerk_of_waves(20);
    const struct {
        double rate, tolerance; // straight lines between samples cost the more, the fewer they are
    } rows[] = {{1000, 0.003}, {400, 0.003}, {200, 0.01}, {100, 0.03}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct meter m = measured(hand, 20 + edges_s + 0.03, rows[i].rate, 0.5);
        assert_near(m.travel.jerk_squared / SMOOTH_RATE_HZ / expected, 1, rows[i].tolerance);
    }
}

static double with_noise(double rate) {
    struct meter m = fresh();
    struct random r = {17};
    for (int i = 0; i < (int)(20 * rate); i++) {
        vec3 noise = {random_normal(&r), random_normal(&r), random_normal(&r)};
        feed(&m, i / rate, vec3_add_scaled(hand(i / rate), 0.1, noise));
    }
    return ldlj(m);
}

static void smoothness_stands_the_noise_of_a_tracker(void **state) {
    (void)state;
    double clean = ldlj(measured(hand, 20, 100, 0));
    assert_near(with_noise(100), clean, 0.1);
    assert_near(with_noise(50), clean, 0.3);
    assert_near(with_noise(500), clean, 0.1);
}

static void noise_leaves_the_jerk_that_is_stated(void **state) {
    (void)state;
    const double rates[] = {50, 100, 200, 1000};
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        struct random r = {31};
        struct meter m = fresh();
        for (int k = 0; k < (int)(300 * rates[i]); k++) {
            vec3 noise = {random_normal(&r), random_normal(&r), random_normal(&r)};
            feed(&m, k / rates[i], vec3_scale(0.1, noise));
        }
        assert_near(travel_jerk(&m.travel) / travel_noise_jerk(rates[i]), 1, 0.06);
    }
}

static void an_instrument_that_never_moved_has_no_smoothness(void **state) {
    (void)state;
    struct meter m = fresh();
    assert_true(isnan(travel_ldlj(&m.travel)) && isnan(travel_economy(&m.travel)));
    assert_true(travel_path_mm(&m.travel) == 0);
    for (int i = 0; i < 300; i++)
        feed(&m, 0.01 * i, (vec3){0});
    assert_true(isnan(travel_ldlj(&m.travel)) && travel_path_mm(&m.travel) == 0);
}

// ---- both hands ---------------------------------------------------------------------------------

static void hands_count_as_a_table_would(void **state) {
    (void)state;
    enum { CELLS = 3000, LATE = 40 };
    static double speeds[5][CELLS];
    struct random r = {23};
    struct hands h;
    int one = 0, two = 0, late[5];
    hands_init(&h);
    for (int k = 0; k < 5; k++)
        late[k] = (int)random_between(&r, 0, LATE);
    for (int c = 0; c < CELLS; c++) {
        int moving = 0;
        for (int k = 0; k < 5; k++) {
            speeds[k][c] = random_between(&r, 0, 6.5);
            moving += speeds[k][c] > HANDS_MOVING_MM_S;
        }
        one += moving > 0;
        two += moving > 1;
    }
    assert_true(isnan(hands_together(&h)));
    for (int c = 0; c < CELLS + LATE; c++) // each instrument comes late by its own
        for (int k = 0; k < 5; k++)
            if (c >= late[k] && c - late[k] < CELLS)
                hands_move(&h, k, 100 + c - late[k], speeds[k][c - late[k]]);
    assert_near(hands_together(&h), (double)two / one, 1e-12);
    assert_near(hands_seconds(&h), 0.01 * one, 1e-9);
    for (int c = 0; c < CELLS - HANDS_WINDOW; c++) // much too late: left out
        hands_move(&h, 0, 100 + c, 100);
    assert_near(hands_together(&h), (double)two / one, 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_filter_has_the_response_that_its_header_states),
        cmocka_unit_test(samples_that_are_not_newer_change_nothing),
        cmocka_unit_test(a_run_may_begin_within_a_cell),
        cmocka_unit_test(a_gap_is_bridged_up_to_the_stated_time),
        cmocka_unit_test(a_circle_has_its_length_at_any_rate),
        cmocka_unit_test(rest_under_noise_is_no_path),
        cmocka_unit_test(smoothing_never_makes_a_path_longer),
        cmocka_unit_test(a_ruler_walks_as_one_on_foot),
        cmocka_unit_test(a_minimum_jerk_reach_has_the_known_smoothness),
        cmocka_unit_test(smoothness_has_no_unit),
        cmocka_unit_test(jerk_is_that_of_the_filtered_motion_at_any_rate),
        cmocka_unit_test(smoothness_stands_the_noise_of_a_tracker),
        cmocka_unit_test(noise_leaves_the_jerk_that_is_stated),
        cmocka_unit_test(an_instrument_that_never_moved_has_no_smoothness),
        cmocka_unit_test(hands_count_as_a_table_would),
    };
    return cmocka_run_group_tests_name("metrics_travel", tests, NULL, NULL);
}
