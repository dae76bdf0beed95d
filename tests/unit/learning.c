// The curve of a trainee: by hand, against the published shares of a simulation, and against the
// exact distribution of the score.

#include "curve/learning.h"

#include "random.h"
#include "test.h"

#include <math.h>
#include <string.h>

#define TRAINEES 10000
#define ATTEMPTS 50
#define SCORES_MAX 4096

static const struct learning_rule *const rule = &learning_rule_knee;

static void the_score_rises_and_falls_as_the_paper_writes(void **state) {
    (void)state;
    const bool tried[] = {true, true, false, true, true};
    const double expected[] = {0.117783, 0.235566, 0, 0.117783, 0.235566}; // ln 9/8, ln 1/2
    struct learning_point points[5];
    learning_curve(rule, tried, 5, points);
    for (int i = 0; i < 5; i++)
        assert_near(points[i].score, expected[i], 1e-6);
    assert_near(learning_weight(rule, false), log(0.5), 1e-12);
}

static void fourteen_successes_make_competent_and_four_failures_a_relapse(void **state) {
    (void)state;
    bool tried[40] = {0};
    struct learning_point points[40];
    for (int i = 0; i < 14; i++)
        tried[i] = true; // 14 ln 9/8 = 1.649
    for (int i = 20; i < 40; i++)
        tried[i] = true;
    learning_curve(rule, tried, 40, points);
    for (int i = 0; i < 40; i++)
        assert_int_equal(points[i].changed, i == 13 || i == 17 || i == 33); // 4 ln 2 = 2.77
    assert_int_equal(points[12].state, LEARNING);
    assert_int_equal(points[13].state, COMPETENT);
    assert_int_equal(points[16].state, COMPETENT);
    assert_near(points[16].score, -3 * log(2), 1e-12);
    assert_int_equal(points[17].state, LEARNING);
    assert_near(points[18].score, 0, 0); // it began anew
    assert_int_equal(points[33].state, COMPETENT);
}

// ---- shares of trainees -------------------------------------------------------------------------

static bool changes_within(struct random *random, enum learning_state begin, double failure_rate) {
    struct learning_point point = {.state = begin};
    for (int i = 0; i < ATTEMPTS; i++) {
        point = learning_next(rule, point, random_between(random, 0, 1) >= failure_rate);
        if (point.changed)
            return true;
    }
    return false;
}

static double simulated_share(enum learning_state begin, double failure_rate) {
    struct random random = {20080703};
    int changed = 0;
    for (int i = 0; i < TRAINEES; i++)
        changed += changes_within(&random, begin, failure_rate);
    return (double)changed / TRAINEES;
}

// The distribution of the score after each attempt, carried on as a list of values and shares.
struct scores {
    double values[SCORES_MAX], shares[SCORES_MAX];
    int count;
};

static void add_share(struct scores *scores, double value, double share) {
    for (int i = 0; i < scores->count; i++)
        if (fabs(scores->values[i] - value) < 1e-9) {
            scores->shares[i] += share;
            return;
        }
    assert_in_range(scores->count, 0, SCORES_MAX - 1);
    scores->values[scores->count] = value;
    scores->shares[scores->count++] = share;
}

// sign 1: up to the limit; -1: down to the relapse. Written out from the paper, not from the room.
static double exact_share(double sign, double limit, double p0, double p1, double failure_rate) {
    static struct scores now, next;
    double up = sign * log((1 - p1) / (1 - p0)), down = sign * log(p1 / p0), reached = 0;
    now.count = 0;
    add_share(&now, 0, 1);
    for (int t = 0; t < ATTEMPTS; t++) {
        next.count = 0;
        for (int i = 0; i < now.count; i++)
            for (int failed = 0; failed < 2; failed++) {
                double value = fmax(0, now.values[i] + (failed ? down : up));
                double share = now.shares[i] * (failed ? failure_rate : 1 - failure_rate);
                if (value >= limit)
                    reached += share;
                else
                    add_share(&next, value, share);
            }
        now = next;
    }
    return reached;
}

static void of_adequate_trainees_nine_in_ten_signal_within_fifty_attempts(void **state) {
    (void)state;
    double share = simulated_share(LEARNING, 0.10);
    print_message("failure rate 0.10: %.4f signal, exactly %.4f; published 0.90\n", share,
                  exact_share(1, 1.6, 0.20, 0.10, 0.10));
    assert_near(share, 0.90, 0.01);
    assert_near(share, exact_share(1, 1.6, 0.20, 0.10, 0.10), 0.012);
}

// No share is published for this rate, which is the rejected one of the weights.
static void of_trainees_at_the_rejected_rate_four_in_ten_signal(void **state) {
    (void)state;
    double share = simulated_share(LEARNING, 0.20);
    print_message("failure rate 0.20: %.4f signal, exactly %.4f\n", share,
                  exact_share(1, 1.6, 0.20, 0.10, 0.20));
    assert_near(share, 0.405, 0.015);
    assert_near(share, exact_share(1, 1.6, 0.20, 0.10, 0.20), 0.015);
}

static void of_inadequate_trainees_one_in_ten_signals_within_fifty_attempts(void **state) {
    (void)state;
    double share = simulated_share(LEARNING, 0.30);
    print_message("failure rate 0.30: %.4f signal, exactly %.4f; published 0.10\n", share,
                  exact_share(1, 1.6, 0.20, 0.10, 0.30));
    assert_near(share, 0.10, 0.015);
    assert_near(share, exact_share(1, 1.6, 0.20, 0.10, 0.30), 0.012);
}

static void weights_of_the_inadequate_rate_would_pass_most_inadequate_trainees(void **state) {
    (void)state;
    assert_near(exact_share(1, 1.6, 0.30, 0.10, 0.30), 0.782, 0.001);
}

static void a_relapse_is_shown_as_often_as_the_header_says(void **state) {
    (void)state;
    double steady = simulated_share(COMPETENT, 0.10), relapsed = simulated_share(COMPETENT, 0.30);
    assert_near(steady, 0.09, 0.012);
    assert_near(relapsed, 0.98, 0.012);
    assert_near(steady, exact_share(-1, 2.6, 0.20, 0.10, 0.10), 0.012);
    assert_near(relapsed, exact_share(-1, 2.6, 0.20, 0.10, 0.30), 0.012);
}

static void a_wrong_rule_is_refused_with_its_numbers(void **state) {
    (void)state;
    const struct learning_rule wrong[] = {
        {0, 0.2, 1.6, 2.6},  {0.2, 0.1, 1.6, 2.6}, {0.1, 1, 1.6, 2.6},        {0.1, 0.2, 0, 2.6},
        {0.1, 0.2, 1.6, -1}, {NAN, 0.2, 1.6, 2.6}, {0.1, 0.2, INFINITY, 2.6}, {0.1, 0.1, 1.6, 2.6}};
    struct error err;
    assert_int_equal(learning_rule_check(rule, &err), RESULT_OK);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_int_equal(learning_rule_check(&wrong[i], &err), RESULT_INVALID);
    learning_rule_check(&wrong[1], &err);
    assert_non_null(strstr(err.text, "0.2 and 0.1"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_score_rises_and_falls_as_the_paper_writes),
        cmocka_unit_test(fourteen_successes_make_competent_and_four_failures_a_relapse),
        cmocka_unit_test(of_adequate_trainees_nine_in_ten_signal_within_fifty_attempts),
        cmocka_unit_test(of_trainees_at_the_rejected_rate_four_in_ten_signal),
        cmocka_unit_test(of_inadequate_trainees_one_in_ten_signals_within_fifty_attempts),
        cmocka_unit_test(weights_of_the_inadequate_rate_would_pass_most_inadequate_trainees),
        cmocka_unit_test(a_relapse_is_shown_as_often_as_the_header_says),
        cmocka_unit_test(a_wrong_rule_is_refused_with_its_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
