// What a trainee is told of others' figures: no figure of anybody, and not what changed when one
// more came.
#include "test.h"
#include "unit/store_files.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST 200

static struct error err;
static struct store *store;
static int numbers; // of sessions

static int begin(void **state) {
    int made = store_folder_begin(state);
    store = open_records();
    numbers = 0;
    return made;
}

static int end(void **state) {
    store_close(&store);
    return store_folder_end(state);
}

static void put(int trainee, double value) {
    struct store_session s = {.start_utc_ns = 1, .part = 1, .state = STATE_CLOSED};
    struct store_result result = {"path", "probe", 1, "mm", value, ""};
    snprintf(s.id, sizeof s.id, "%032x", ++numbers);
    snprintf(s.station, sizeof s.station, "room-1");
    if (trainee)
        snprintf(s.trainee, sizeof s.trainee, "trainee-%d", trainee);
    snprintf(s.case_name, sizeof s.case_name, "healthy");
    snprintf(s.trace, sizeof s.trace, "/none");
    assert_int_equal(store_put_session(store, &s, &result, 1, &err), RESULT_OK);
}

struct told {
    int count;
    double values[MOST];
};

static void take(void *user, const struct store_cell *cells, int count) {
    struct told *told = user;
    assert_int_equal(count, 5);
    assert_string_equal(cells[0].text, "path");
    assert_string_equal(cells[1].text, "probe");
    assert_int_equal(cells[2].integer, 1);
    assert_string_equal(cells[3].text, "mm");
    told->values[told->count++] = cells[4].real;
}

static struct told tell(bool hide_few) {
    struct told told = {0};
    assert_int_equal(store_figures_on(store, "healthy", NULL, hide_few, take, &told, &err),
                     RESULT_OK);
    return told;
}

// The step: a tenth of the range, up to 1, 2 or 5 times a power of ten.
static double step_of(double range) {
    double steps[] = {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50};
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++)
        if (steps[i] >= range / 10 * (1 - 1e-12))
            return steps[i];
    fail_msg("no step");
    return 0;
}

static void each_is_the_mean_of_a_group_of_five_trainees(void **state) {
    (void)state;
    srandom(7);
    static int trainees[MOST];
    for (int i = 0; i < 60; i++) { // in rising order, of 12 trainees and nobody
        trainees[i] = (int)(random() % 13);
        put(trainees[i], i * 0.31);
    }
    struct told raw = tell(false), told = tell(true);
    assert_int_equal(raw.count, 60);
    assert_int_equal(told.count, 60);
    double step = step_of(59 * 0.31);
    int groups = 0;
    for (int from = 0, to; from < 60; from = to, groups++) {
        bool seen[13] = {true}; // nobody counts for nobody
        int count = 0;
        double mean = 0;
        for (to = from; to < 60 && told.values[to] == told.values[from]; to++) {
            count += !seen[trainees[to]];
            seen[trainees[to]] = true;
            mean += raw.values[to];
        }
        assert_true(count >= STORE_TRAINEES_MIN);
        assert_near(told.values[from], mean / (to - from), step / 2 + 1e-9);
        assert_near(told.values[from] / step, round(told.values[from] / step), 1e-9);
    }
    assert_true(groups >= 5);
}

static void four_trainees_are_too_few_however_often_they_came(void **state) {
    (void)state;
    for (int i = 0; i < 40; i++)
        put(1 + i % 4, i);
    for (int i = 0; i < 10; i++)
        put(0, 100 + i);
    assert_int_equal(tell(true).count, 0);
    put(5, 20);
    assert_int_equal(tell(true).count, 51);
}

// A trainee who looks before and after a classmate's session knows all but one figure.
static void a_difference_does_not_tell_the_new_figure(void **state) {
    (void)state;
    static double sums[50];
    int different = 0;
    for (int i = 0; i < 50; i++) {
        end(state);
        begin(state);
        for (int t = 1; t <= 9; t++)
            put(t, 10 * t);
        put(10, 20 + i); // over more than half of the range
        struct told told = tell(true);
        assert_int_equal(told.count, 10);
        for (int j = 0; j < told.count; j++)
            sums[i] += told.values[j];
        bool known = false;
        for (int j = 0; j < i; j++)
            known = known || fabs(sums[j] - sums[i]) < 1e-9;
        different += !known;
    }
    assert_in_range(different, 1, 5);
}

static void equal_figures_have_a_step_too(void **state) {
    (void)state;
    for (int t = 1; t <= 6; t++)
        put(t, 4.37);
    assert_near(tell(true).values[0], 4.5, 1e-9);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, end)
        TEST(each_is_the_mean_of_a_group_of_five_trainees),
        TEST(four_trainees_are_too_few_however_often_they_came),
        TEST(a_difference_does_not_tell_the_new_figure),
        TEST(equal_figures_have_a_step_too),
    };
    return cmocka_run_group_tests_name("store_figures", tests, NULL, NULL);
}
