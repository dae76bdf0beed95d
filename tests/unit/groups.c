// Pass marks from two groups: against closed forms, and where there is none.

#include "curve/groups.h"

#include "test.h"

#include <string.h>

// Five figures with this mean and standard deviation: -1.5 -0.5 0 0.5 1.5 have the variance 5/4.
static const double *five(double mean, double sd, double out[5]) {
    const double shape[5] = {-1.5, -0.5, 0, 0.5, 1.5};
    for (int i = 0; i < 5; i++)
        out[i] = mean + sd * shape[i] / sqrt(1.25);
    return out;
}

static enum result mark_of(double novice_mean, double novice_sd, double expert_mean,
                           double expert_sd, bool less, struct contrasting_groups *out,
                           struct error *err) {
    double novices[5], experts[5];
    return contrasting_groups(five(novice_mean, novice_sd, novices), 5,
                              five(expert_mean, expert_sd, experts), 5, less, out, err);
}

static void equal_spreads_cross_in_the_middle(void **state) {
    (void)state;
    struct contrasting_groups found;
    struct error err;
    assert_ok(mark_of(504, 60, 384, 60, true, &found, &err)); // times: 8:24 and 6:24
    assert_near(found.mark, 444, 1e-6);
    assert_near(found.novices.sd, 60, 1e-9);
    assert_near(found.false_pass, 0.158655, 1e-6); // a standard deviation beyond
    assert_near(found.false_fail, 0.158655, 1e-6);
    assert_int_equal(found.novices_passing, 1); // 504 - 80.5 = 423.5
    assert_int_equal(found.experts_failing, 1);
}

// ln a + (x - m)^2 / 2a^2 = ln b + (x - n)^2 / 2b^2, solved as a quadratic.
static double root(double m, double a, double n, double b) {
    double p = 1 / (a * a) - 1 / (b * b), q = -2 * (m / (a * a) - n / (b * b));
    double r = m * m / (a * a) - n * n / (b * b) + 2 * log(a / b), d = sqrt(q * q - 4 * p * r);
    double x = (-q + d) / (2 * p), y = (-q - d) / (2 * p);
    return x > fmin(m, n) && x < fmax(m, n) ? x : y;
}

static void unequal_spreads_cross_at_the_root_of_the_quadratic(void **state) {
    (void)state;
    struct contrasting_groups found;
    struct error err;
    const double rows[][4] = {{504, 90, 384, 40}, {20, 3, 33, 6}, {9, 4, 2, 1.5}, {-3, 1, 3, 5}};
    for (int i = 0; i < 4; i++) {
        const double *r = rows[i];
        assert_ok(mark_of(r[0], r[1], r[2], r[3], r[2] < r[0], &found, &err));
        assert_near(found.mark, root(r[0], r[1], r[2], r[3]), 1e-9 * fabs(r[0]));
        double beyond = fabs(found.mark - r[0]) / r[1];
        assert_near(found.false_pass, erfc(beyond / sqrt(2)) / 2, 1e-9);
    }
}

static void groups_without_a_mark_are_refused_and_told_why(void **state) {
    (void)state;
    struct contrasting_groups found;
    struct error err;
    double a[5], b[5];
    five(500, 60, a);
    five(400, 60, b);
    assert_int_equal(contrasting_groups(a, 4, b, 5, true, &found, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "4 novices: a pass mark needs 5"));
    assert_int_equal(contrasting_groups(a, 5, b, 5, false, &found, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "not better"));
    assert_int_equal(mark_of(100, 5, 99, 50, true, &found, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "overlap"));
    assert_int_equal(mark_of(100, 0, 90, 5, true, &found, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "novices: all figures are the same"));
    a[2] = NAN;
    assert_int_equal(contrasting_groups(a, 5, b, 5, true, &found, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "figure 3"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_spreads_cross_in_the_middle),
        cmocka_unit_test(unequal_spreads_cross_at_the_root_of_the_quadratic),
        cmocka_unit_test(groups_without_a_mark_are_refused_and_told_why),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
