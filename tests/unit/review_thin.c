// A line in few points: what of it stays.
#include "random.h"
#include "review/thin.h"
#include "test.h"

#include <math.h>
#include <stdbool.h>

static struct thin thin;
static double xs[THIN_POINTS], ys[THIN_POINTS];

static double low(const double *values, size_t count) {
    double least = INFINITY;
    for (size_t i = 0; i < count; i++)
        least = fmin(least, values[i]); // NaN: the other
    return least;
}

static double high(const double *values, size_t count) {
    double most = -INFINITY;
    for (size_t i = 0; i < count; i++)
        most = fmax(most, values[i]);
    return most;
}

static void a_short_line_stays_as_it_is(void **state) {
    (void)state;
    thin_init(&thin);
    assert_int_equal(thin_points(&thin, xs, ys), 0);
    for (int i = 0; i < 100; i++)
        thin_add(&thin, i / 99.0, i, i % 7);
    assert_int_equal(thin_points(&thin, xs, ys), 100);
    for (int i = 0; i < 100; i++)
        assert_true(xs[i] == i && ys[i] == i % 7);
}

// Points of a walk, one of them far off: it and the ends of each cell's range are kept, in order.
static void no_peak_is_lost_and_the_order_is_kept(void **state) {
    (void)state;
    enum { COUNT = 200000 };
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct random r = {seed};
        double least[THIN_CELLS], most[THIN_CELLS], at = 0;
        int peak = (int)(random_bits(&r) % COUNT);
        for (int c = 0; c < THIN_CELLS; c++) {
            least[c] = INFINITY;
            most[c] = -INFINITY;
        }
        thin_init(&thin);
        for (int i = 0; i < COUNT; i++) {
            at += random_between(&r, -1, 1);
            double y = i == peak ? 1e6 : at;
            int cell = (int)((double)i / COUNT * THIN_CELLS);
            least[cell] = fmin(least[cell], y);
            most[cell] = fmax(most[cell], y);
            thin_add(&thin, (double)i / COUNT, i, y);
        }
        size_t count = thin_points(&thin, xs, ys);
        assert_in_range(count, THIN_CELLS, THIN_POINTS);
        assert_true(high(ys, count) == 1e6);
        for (size_t i = 0; i < count;) {
            int cell = (int)(xs[i] / COUNT * THIN_CELLS);
            size_t end = i;
            while (end < count && (int)(xs[end] / COUNT * THIN_CELLS) == cell)
                end++;
            assert_true(low(ys + i, end - i) == least[cell]);
            assert_true(high(ys + i, end - i) == most[cell]);
            i = end;
        }
        for (size_t i = 1; i < count; i++)
            assert_true(xs[i] > xs[i - 1]);
    }
}

// A path that turns back: the farthest to each side, though neither highest nor lowest.
static void the_sides_of_a_path_are_kept_too(void **state) {
    (void)state;
    thin_init(&thin);
    for (int i = 0; i < 1000; i++)
        thin_add(&thin, 0.5, i == 400 ? -5 : i == 600 ? 5 : 0, i % 3);
    size_t count = thin_points(&thin, xs, ys);
    assert_in_range(count, 2, THIN_KEPT);
    assert_true(low(xs, count) == -5 && high(xs, count) == 5);
    assert_true(low(ys, count) == 0 && high(ys, count) == 2);
}

static void a_break_lies_between_what_it_parts(void **state) {
    (void)state;
    thin_init(&thin);
    thin_add(&thin, 0.1, 1, 10);
    thin_break(&thin, 0.2);
    thin_add(&thin, 0.3, 3, 30);
    assert_int_equal(thin_points(&thin, xs, ys), 3);
    assert_true(xs[0] == 1 && isnan(xs[1]) && isnan(ys[1]) && xs[2] == 3);
}

static void the_ends_of_the_order_and_a_full_line_have_room(void **state) {
    (void)state;
    thin_init(&thin);
    for (int c = 0; c < THIN_CELLS; c++) {
        static const double path[THIN_KEPT][2] = {{0, 0}, {-1, 0.5}, {1, -0.5}, {0.5, -1}, {0, 1}};
        for (int i = 0; i < THIN_KEPT; i++)
            thin_add(&thin, (c + 0.1 * (i + 1)) / THIN_CELLS, path[i][0], path[i][1]);
        thin_break(&thin, (c + 0.9) / THIN_CELLS);
    }
    assert_int_equal(thin_points(&thin, xs, ys), THIN_POINTS);
    thin_init(&thin);
    thin_add(&thin, 0, 1, 1);
    thin_add(&thin, 1, 2, 2);
    thin_add(&thin, 1 + 1e-9, 3, 3); // rounding
    assert_int_equal(thin_points(&thin, xs, ys), 3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_short_line_stays_as_it_is),
        cmocka_unit_test(no_peak_is_lost_and_the_order_is_kept),
        cmocka_unit_test(the_sides_of_a_path_are_kept_too),
        cmocka_unit_test(a_break_lies_between_what_it_parts),
        cmocka_unit_test(the_ends_of_the_order_and_a_full_line_have_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
