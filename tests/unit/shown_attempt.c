// The attempt that viewers are shown: its time between two words of the server.

#include "view/shown_attempt.h"

#include "base/clock.h"
#include "test.h"

#include <string.h>

static struct shown_attempt shown;

static int begin(void **state) {
    (void)state;
    shown = (struct shown_attempt){.now_ns = 0};
    return 0;
}

static void tell(int64_t time_ns, arthron_AttemptState_End end) {
    arthron_AttemptState state = {.number = 1, .time_ns = time_ns, .limit_s = 60, .end = end};
    shown_attempt_take(&shown, &state);
}

static int64_t time_at(double seconds, bool runs) {
    arthron_View view = {.number = 7};
    shown_attempt_go_on(&shown, (int64_t)(seconds * NS_PER_S), runs);
    shown_attempt_put(&shown, &view);
    assert_true(view.has_attempt);
    return view.attempt.time_ns;
}

static void its_time_goes_on_while_it_and_the_session_run(void **state) {
    (void)state;
    shown_attempt_go_on(&shown, 100 * NS_PER_S, true);
    tell(0, arthron_AttemptState_End_RUNS);
    assert_int_equal(time_at(102, true), 2 * NS_PER_S);
    assert_int_equal(time_at(105, false), 2 * NS_PER_S); // a pause
    assert_int_equal(time_at(106, true), 3 * NS_PER_S);
    tell(7 * NS_PER_S, arthron_AttemptState_End_RUNS); // the server knows better
    assert_int_equal(time_at(106.5, true), 7 * NS_PER_S + NS_PER_S / 2);
    tell(8 * NS_PER_S, arthron_AttemptState_End_DONE);
    assert_int_equal(time_at(120, true), 8 * NS_PER_S);
}

static void its_time_does_not_pass_its_limit(void **state) {
    (void)state;
    shown_attempt_go_on(&shown, 100 * NS_PER_S, true);
    tell(59 * NS_PER_S, arthron_AttemptState_End_RUNS);
    assert_int_equal(time_at(105, true), 60 * NS_PER_S);
    assert_int_equal(time_at(106, true), 60 * NS_PER_S);
    tell(61 * NS_PER_S, arthron_AttemptState_End_RUNS); // what the server says counts
    assert_int_equal(time_at(107, true), 61 * NS_PER_S);
    tell(INT64_MIN, arthron_AttemptState_End_RUNS);
    assert_int_equal(time_at(107, true), 0);
}

static void a_session_without_one_shows_none(void **state) {
    (void)state;
    arthron_View view = {.number = 7};
    shown_attempt_go_on(&shown, NS_PER_S, true);
    shown_attempt_put(&shown, &view);
    assert_false(view.has_attempt);
    tell(0, arthron_AttemptState_End_RUNS);
    assert_int_equal(time_at(2, true), NS_PER_S);
    shown_attempt_take(&shown, &(arthron_AttemptState){.number = 0});
    shown_attempt_put(&shown, &view);
    assert_false(view.has_attempt);
}

static void goals_errors_and_names_are_the_servers(void **state) {
    (void)state;
    arthron_AttemptState told = {.number = 4,
                                 .purpose = arthron_AttemptState_Purpose_EXAM,
                                 .hand = arthron_AttemptState_Hand_LEFT_HAND,
                                 .goals_count = 1,
                                 .errors_count = 1,
                                 .end = arthron_AttemptState_End_TIME_OUT,
                                 .verdict = arthron_AttemptState_Verdict_NOT_YET,
                                 .pass_time_s = 30,
                                 .pass_errors = 2,
                                 .in_order = true};
    arthron_View view = {.number = 7};
    const arthron_ViewAttempt *a = &view.attempt;
    strcpy(told.task, "centring");
    strcpy(told.title, "Centring");
    told.goals[0] = (arthron_AttemptGoal){"notch", true, 5};
    told.errors[0] = (arthron_AttemptError){"bump", 6, true};
    shown_attempt_take(&shown, &told);
    shown_attempt_put(&shown, &view);
    assert_string_equal(a->task, "centring");
    assert_string_equal(a->title, "Centring");
    assert_int_equal(a->purpose, arthron_AttemptState_Purpose_EXAM);
    assert_int_equal(a->hand, arthron_AttemptState_Hand_LEFT_HAND);
    assert_memory_equal(a->goals, told.goals, sizeof a->goals);
    assert_memory_equal(a->errors, told.errors, sizeof a->errors);
    assert_int_equal(a->goals_count + a->errors_count, 2);
    assert_int_equal(a->end, arthron_AttemptState_End_TIME_OUT);
    assert_int_equal(a->verdict, arthron_AttemptState_Verdict_NOT_YET);
    assert_true(a->pass_time_s == 30 && a->pass_errors == 2 && a->in_order);
}

#define TEST(name) cmocka_unit_test_setup(name, begin)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(its_time_goes_on_while_it_and_the_session_run),
        TEST(its_time_does_not_pass_its_limit),
        TEST(a_session_without_one_shows_none),
        TEST(goals_errors_and_names_are_the_servers),
    };
    return cmocka_run_group_tests_name("shown_attempt", tests, NULL, NULL);
}
