#include "warp/curve.h"

#include "random.h"
#include "test.h"

#include <string.h>

static double at(const struct curve *curve, double x, int component) {
    double value[CURVE_COMPONENTS];
    curve_at(curve, x, value);
    return value[component];
}

static void some_curve(struct curve *curve, struct random *r, int count) {
    *curve = (struct curve){0};
    while (curve->count < count) {
        double value[CURVE_COMPONENTS];
        for (int k = 0; k < CURVE_COMPONENTS; k++)
            value[k] = random_between(r, -10, 10);
        curve_add(curve, random_between(r, 0, 120), 1, value);
    }
    curve_finish(curve);
}

static void a_curve_goes_through_its_knots_and_stays_between_them(void **state) {
    (void)state;
    struct random r = {1};
    for (int trial = 0; trial < 200; trial++) {
        struct curve c;
        some_curve(&c, &r, 1 + trial % 8);
        for (int k = 0; k < CURVE_COMPONENTS; k++) {
            for (int i = 0; i < c.count; i++)
                assert_near(at(&c, c.at[i], k), c.value[i][k], 0);
            for (int i = 0; i + 1 < c.count; i++) {
                double up = c.value[i + 1][k] > c.value[i][k] ? 1 : -1, last = c.value[i][k];
                for (int n = 1; n <= 100; n++) {
                    double x = c.at[i] + (c.at[i + 1] - c.at[i]) * n / 100;
                    assert_true(up * (at(&c, x, k) - last) >= -1e-12);
                    last = at(&c, x, k);
                }
            }
        }
    }
}

static void a_curve_is_smooth_and_constant_outside(void **state) {
    (void)state;
    struct random r = {2};
    for (int trial = 0; trial < 200; trial++) {
        struct curve c;
        some_curve(&c, &r, 1 + trial % 8);
        for (int k = 0; k < CURVE_COMPONENTS; k++) {
            for (int i = 0; i < c.count; i++) {
                double h = 1e-6, here = c.value[i][k];
                double before = (here - at(&c, c.at[i] - h, k)) / h;
                double after = (at(&c, c.at[i] + h, k) - here) / h;
                assert_near(before, after, 1e-3);
            }
            assert_near(at(&c, c.at[0] - 50, k), c.value[0][k], 0);
            assert_near(at(&c, c.at[c.count - 1] + 50, k), c.value[c.count - 1][k], 0);
        }
    }
}

// Worked by hand: slopes 0, (1 + 3)/2 = 2, 0 and secants 1 and 3 fit into circles of radius 3.
static void a_piece_is_the_cubic_of_its_slopes(void **state) {
    (void)state;
    struct curve c = {0};
    curve_add(&c, 2, 0.1, (const double[CURVE_COMPONENTS]){4});
    curve_add(&c, 0, 0.1, (const double[CURVE_COMPONENTS]){0});
    curve_add(&c, 1, 0.1, (const double[CURVE_COMPONENTS]){1});
    curve_finish(&c);
    assert_near(at(&c, 0.5, 0), 0.5 - 2.0 / 8, 1e-15); // mean − slope · width / 8
    assert_near(at(&c, 1.5, 0), 2.5 + 2.0 / 8, 1e-15);
}

static void knots_too_close_are_not_taken(void **state) {
    (void)state;
    struct curve c = {0};
    const double value[CURVE_COMPONENTS] = {1, 2, 3, 4, 5, 6};
    assert_true(curve_add(&c, 10, 1, value));
    assert_false(curve_add(&c, 10.9, 1, value));
    assert_false(curve_add(&c, 9.1, 1, value));
    assert_true(curve_add(&c, 9, 1, value));
    assert_int_equal(c.count, 2);
}

static void a_curve_without_knots_is_zero(void **state) {
    (void)state;
    struct curve c = {0};
    curve_finish(&c);
    for (int k = 0; k < CURVE_COMPONENTS; k++)
        assert_near(at(&c, 5, k), 0, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_curve_goes_through_its_knots_and_stays_between_them),
        cmocka_unit_test(a_curve_is_smooth_and_constant_outside),
        cmocka_unit_test(a_piece_is_the_cubic_of_its_slopes),
        cmocka_unit_test(knots_too_close_are_not_taken),
        cmocka_unit_test(a_curve_without_knots_is_zero),
    };
    return cmocka_run_group_tests_name("curve", tests, NULL, NULL);
}
