// Agreement of raters, and quartiles: against published tables, by hand, and closed forms.

#include "curve/agreement.h"

#include "curve/quartiles.h"
#include "random.h"
#include "test.h"

#include <string.h>

// Shrout and Fleiss 1979, table 2: four judges rate six targets.
static void icc_is_that_of_shrout_and_fleiss(void **state) {
    (void)state;
    const double ratings[] = {9, 2, 5, 8, 6,  1, 3, 2, 8, 4, 6, 8,
                              7, 1, 2, 6, 10, 5, 6, 9, 6, 2, 4, 7};
    struct intraclass found;
    struct error err;
    assert_ok(intraclass(ratings, 6, 4, &found, &err));
    assert_near(found.icc_1_1, 0.17, 0.005); // table 4
    assert_near(found.icc_2_1, 0.29, 0.005);
}

static void icc_of_two_raters_is_that_computed_by_hand(void **state) {
    (void)state;
    // Means of targets 1.5, 2.5, 3.5, of raters 2, 3, of all 2.5: BMS 2, WMS 0.5, JMS 1.5, EMS 0.
    const double ratings[] = {1, 2, 2, 3, 3, 4};
    struct intraclass found;
    struct error err;
    assert_ok(intraclass(ratings, 3, 2, &found, &err));
    assert_near(found.icc_1_1, (2 - 0.5) / (2 + 0.5), 1e-12);
    assert_near(found.icc_2_1, 2 / (2 + 2 * 1.5 / 3), 1e-12);
}

static void icc_refuses_ratings_that_say_nothing(void **state) {
    (void)state;
    const double same[] = {3, 3, 3, 3};
    struct intraclass found;
    struct error err;
    assert_int_equal(intraclass(same, 2, 2, &found, &err), RESULT_REFUSED);
    assert_int_equal(intraclass(same, 1, 2, &found, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "at least 2"));
}

static void kappa_is_that_computed_by_hand(void **state) {
    (void)state;
    int first[50], second[50], count = 0;
    const int cells[4] = {20, 5, 10, 15};
    for (int cell = 0; cell < 4; cell++)
        for (int i = 0; i < cells[cell]; i++, count++)
            first[count] = cell / 2, second[count] = cell % 2;
    struct error err;
    double found;
    assert_ok(kappa(first, second, 50, 2, KAPPA_PLAIN, &found, &err));
    assert_near(found, 0.4, 1e-12); // observed 0.7, by chance 0.5

    const int x[] = {0, 0, 1, 1, 2, 2}, y[] = {0, 1, 1, 2, 2, 2};
    assert_ok(kappa(x, y, 6, 3, KAPPA_PLAIN, &found, &err));
    assert_near(found, 0.5, 1e-12); // apart 2 of 6, by chance 24 of 36
    assert_ok(kappa(x, y, 6, 3, KAPPA_LINEAR, &found, &err));
    assert_near(found, 0.625, 1e-12); // by chance 32 of 36
}

// Fleiss and Cohen 1973: with quadratic weights kappa is a ratio of moments.
static void quadratic_kappa_is_the_ratio_of_moments(void **state) {
    (void)state;
    struct random random = {7};
    int first[60], second[60];
    double sums[2] = {0}, squares[2] = {0}, apart = 0;
    for (int i = 0; i < 60; i++) {
        first[i] = (int)(random_bits(&random) % 5);
        second[i] = (first[i] + (int)(random_bits(&random) % 3)) % 5;
        sums[0] += first[i], sums[1] += second[i];
        squares[0] += first[i] * first[i], squares[1] += second[i] * second[i];
        apart += (first[i] - second[i]) * (first[i] - second[i]);
    }
    double means[2] = {sums[0] / 60, sums[1] / 60};
    double chance = squares[0] / 60 + squares[1] / 60 - 2 * means[0] * means[1], found;
    struct error err;
    assert_ok(kappa(first, second, 60, 5, KAPPA_QUADRATIC, &found, &err));
    assert_near(found, 1 - apart / 60 / chance, 1e-12);
}

static void kappa_refuses_what_says_nothing_and_what_is_no_level(void **state) {
    (void)state;
    const int same[] = {1, 1, 1}, wrong[] = {1, 1, 5};
    double found;
    struct error err;
    assert_int_equal(kappa(same, same, 3, 3, KAPPA_PLAIN, &found, &err), RESULT_REFUSED);
    assert_int_equal(kappa(same, same, 0, 3, KAPPA_PLAIN, &found, &err), RESULT_REFUSED);
    assert_int_equal(kappa(same, wrong, 3, 3, KAPPA_PLAIN, &found, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "rating 3"));
}

// R: quantile(c(1, 2, 3, 4)) is 1.00 1.75 2.50 3.25 4.00.
static void quartiles_are_those_of_definition_seven(void **state) {
    (void)state;
    const double figures[] = {1, 2, 3, 4};
    assert_near(sorted_quantile(figures, 4, 0.25), 1.75, 1e-12);
    assert_near(sorted_quantile(figures, 4, 0.5), 2.5, 1e-12);
    assert_near(sorted_quantile(figures, 4, 1), 4, 1e-12);
    assert_near(sorted_quantile(figures, 1, 0.75), 1, 1e-12);
}

static void a_course_has_quartiles_where_enough_made_the_attempt(void **state) {
    (void)state;
    const double figures[] = {30, 20, 10, 10, 40, 20, 50};
    const int starts[] = {0, 2, 3, 3, 5, 7}; // 30 20 | 10 | | 10 40 | 20 50
    struct quartiles curve[3];
    quartile_curve(figures, starts, 5, 3, 3, curve);
    assert_int_equal(curve[0].count, 4);
    assert_near(curve[0].low, 10, 1e-12);
    assert_near(curve[0].middle, 15, 1e-12);
    assert_near(curve[0].high, 22.5, 1e-12);
    assert_int_equal(curve[1].count, 3);
    assert_near(curve[1].middle, 40, 1e-12);
    assert_int_equal(curve[2].count, 0);
    assert_true(isnan(curve[2].middle));
    quartile_curve(figures, starts, 5, 3, 4, curve);
    assert_true(isnan(curve[1].low) && isnan(curve[1].high));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(icc_is_that_of_shrout_and_fleiss),
        cmocka_unit_test(icc_of_two_raters_is_that_computed_by_hand),
        cmocka_unit_test(icc_refuses_ratings_that_say_nothing),
        cmocka_unit_test(kappa_is_that_computed_by_hand),
        cmocka_unit_test(quadratic_kappa_is_the_ratio_of_moments),
        cmocka_unit_test(kappa_refuses_what_says_nothing_and_what_is_no_level),
        cmocka_unit_test(quartiles_are_those_of_definition_seven),
        cmocka_unit_test(a_course_has_quartiles_where_enough_made_the_attempt),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
