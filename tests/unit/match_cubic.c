#include "match/cubic.h"
#include "random.h"
#include "test.h"

static struct cubic with_roots(double lead, double a, double b, double c) {
    return (struct cubic){
        {-lead * a * b * c, lead * (a * b + b * c + c * a), -lead * (a + b + c), lead}};
}

static void a_cubic_is_followed_to_its_first_root(void **state) {
    (void)state;
    struct random r = {12};
    for (int i = 0; i < 20000; i++) {
        double a = random_between(&r, 0, 1), b = random_between(&r, 0, 1);
        double c = random_between(&r, 0, 1), s;
        double apart = fmin(fabs(a - b), fmin(fabs(b - c), fabs(c - a)));
        struct cubic p = with_roots(-1, a, b, c);
        int steps = 0;
        assert_true(cubic_descend(&p, 0, 1, 1e-15, &s, &steps));
        if (apart > 1e-3)
            assert_near(s, fmin(a, fmin(b, c)), 1e-8);
        assert_true(steps <= 60);
    }
}

static void roots_before_the_interval_do_not_count(void **state) {
    (void)state;
    struct cubic p = with_roots(-1, 0.2, 0.4, 0.8);
    int steps = 0;
    double s;
    assert_true(cubic_descend(&p, 0.5, 1, 1e-15, &s, &steps));
    assert_near(s, 0.8, 1e-12);
    assert_true(cubic_descend(&p, 0.3, 1, 1e-15, &s, &steps)); // already below 0
    assert_near(s, 0.3, 0);
    assert_false(cubic_descend(&p, 0.5, 0.7, 1e-15, &s, &steps));
}

static void a_cubic_that_stays_above_0_is_followed_to_its_least(void **state) {
    (void)state;
    struct random r = {13};
    for (int i = 0; i < 5000; i++) {
        struct cubic p = {{1}};
        for (int k = 1; k < 4; k++)
            p.c[k] = i % (k + 1) ? random_between(&r, -3, 3) : 0; // lines and parabolas among them
        double least = p.c[0], s;
        for (int k = 0; k <= 1000; k++)
            least = fmin(least, cubic_at(&p, k / 1000.0));
        p.c[0] += 0.1 - least;
        int steps = 0;
        assert_false(cubic_descend(&p, 0, 1, 1e-15, &s, &steps));
        assert_true(s >= 0 && s <= 1);
        assert_near(cubic_at(&p, s), 0.1, 1e-5);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cubic_is_followed_to_its_first_root),
        cmocka_unit_test(roots_before_the_interval_do_not_count),
        cmocka_unit_test(a_cubic_that_stays_above_0_is_followed_to_its_least),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
