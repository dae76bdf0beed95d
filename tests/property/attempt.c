// The time of an attempt, its end, its copies, and what a case lacks.
#include "attempt_body.h"

#include <stdio.h>
#include <string.h>

static void a_pause_does_not_count(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nhold_s = 1\n");
    see_patella(25);
    steps(50);
    output.state = SESSION_PAUSED;
    assert_int_equal(steps(1000).goals_met, 0);
    assert_near(attempt_time_s(&attempt), 0.5, 0.011);
    output.state = SESSION_RUNNING;
    assert_int_equal(steps(52).goals_met, 1);
    assert_near(attempt_time_s(&attempt), 1.0, 0.03);
}

static void who_takes_too_long_does_not_pass(void **state) {
    (void)state;
    begin("[goal a]\nvalgus_deg = 4\nhold_s = 0.1\n");
    for (int late = 0; late < 2; late++) {
        attempt_init(&attempt);
        bend(20, 0, 0);
        steps(2985 + 10 * late);
        bend(20, 5, 0);
        steps(11);
        assert_int_equal(attempt.end, ATTEMPT_DONE);
        assert_int_equal(attempt_verdict(&attempt, &task), late ? VERDICT_NOT_YET : VERDICT_PASSED);
    }
}

static void the_limit_and_the_end_of_a_session_end_it(void **state) {
    (void)state;
    begin(FAR_GOAL);
    steps(6000);
    assert_int_equal(attempt.end, ATTEMPT_RUNS);
    steps(2);
    assert_int_equal(attempt.end, ATTEMPT_TIME_OUT);
    attempt_init(&attempt);
    steps(10);
    output.state = SESSION_CLOSED;
    steps(1);
    assert_int_equal(attempt.end, ATTEMPT_STOPPED);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_NOT_YET);
}

// A copy that goes on has the bytes of what was copied, at any step.
static void a_copy_goes_on_with_the_same_bytes(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\nhold_s = 0.3\n[goal b]\nvalgus_deg = 4\n" FAR_GOAL
          "[error deep]\ndeep_mm = 1\n");
    struct attempt copy;
    for (int i = 0; i < 400; i++) {
        see_patella(random_between(&noise, 20, 45));
        touch(PROBE, "tibia", trembling(landmark("plateau_medial")), 0.1,
              random_between(&noise, 0, 2));
        bend(20, random_between(&noise, 0, 6), 0);
        if (i % 50 == 0)
            copy = attempt;
        steps(1);
        attempt_step(&copy, site, &output);
        assert_memory_equal(&copy, &attempt, sizeof copy);
    }
    assert_true(attempt.goals_met > 0 && attempt.errors > 0);
}

static void what_a_case_lacks_is_named(void **state) {
    (void)state;
    begin("[goal a]\nsee = patella\n");
    const struct {
        const char *see, *tool, *says;
        const char *take_out;
    } rows[] = {{"patela", "probe", "task one: [goal a]: the case has no landmark patela", ""},
                {"", "grasper", "task one: [goal a]: no instrument is called grasper", ""},
                {"", "probe", "task one: [goal a]: the case has no loose body piece", "piece"}};
    struct view_optic optic = view_optic_usual();
    struct site *other;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        snprintf(task.goals[0].see, sizeof task.goals[0].see, "%s", rows[i].see);
        snprintf(task.goals[0].take_out, sizeof task.goals[0].take_out, "%s", rows[i].take_out);
        snprintf(task.goals[0].touch, sizeof task.goals[0].touch, "patella");
        snprintf(task.goals[0].tool, sizeof task.goals[0].tool, "%s", rows[i].tool);
        assert_int_equal(site_create(&task, scene, instruments_usual(), &optic, &other, &err),
                         RESULT_MISSING);
        assert_string_equal(err.text, rows[i].says);
    }
}

static void a_portal_or_an_optic_that_is_not_there_is_named(void **state) {
    (void)state;
    struct view_optic optic = view_optic_usual();
    struct site *other;
    begin("[goal a]\nsee = patella\n");
    task.optic_deg = 70;
    assert_int_equal(site_create(&task, scene, instruments_usual(), &optic, &other, &err),
                     RESULT_INVALID);
    assert_string_equal(err.text, "task one: it needs an optic of 70 degrees, and this one has 30");
    task.optic_deg = 30;
    snprintf(task.goals[0].scope_portal, sizeof task.goals[0].scope_portal, "central");
    assert_int_equal(site_create(&task, scene, instruments_usual(), &optic, &other, &err),
                     RESULT_MISSING);
    assert_string_equal(err.text, "task one: [goal a]: the case has no portal central");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pause_does_not_count),
        cmocka_unit_test(who_takes_too_long_does_not_pass),
        cmocka_unit_test(the_limit_and_the_end_of_a_session_end_it),
        cmocka_unit_test(a_copy_goes_on_with_the_same_bytes),
        cmocka_unit_test(what_a_case_lacks_is_named),
        cmocka_unit_test(a_portal_or_an_optic_that_is_not_there_is_named),
    };
    return cmocka_run_group_tests_name("attempt", tests, make_case, drop_case);
}
