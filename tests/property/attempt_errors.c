// Errors of a task: each made once, and just not. attempt_kinds.c has all under noise.
#include "attempt_body.h"

#include <string.h>

static void an_error_counts_once_for_each_time(void **state) {
    (void)state;
    begin(FAR_GOAL "[error deep]\ntool = probe\ndeep_mm = 1\ngroups = femur tibia\nfor_s = 0.3\n");
    vec3 at = landmark("plateau_medial");
    touch(PROBE, "tibia", at, 0, 0.95); // not deep enough
    steps(100);
    touch(PROBE, "meniscus_medial", at, 0, 3); // deep in something else
    steps(100);
    touch(SHAVER, "tibia", at, 0, 3); // another tool
    steps(100);
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(29); // not for long enough
    touch(PROBE, "tibia", at, 0, 0);
    steps(100);
    assert_int_equal(attempt.errors, 0);
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(200);
    assert_int_equal(attempt.errors, 1);
    touch(PROBE, "tibia", at, 0, 0);
    steps(30); // the same one: it was gone for too short a time
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(100);
    assert_int_equal(attempt.errors, 1);
    touch(PROBE, "tibia", at, 0, 0);
    steps(60);
    touch(PROBE, "tibia", at, 0, 1.05);
    steps(100);
    assert_int_equal(attempt.errors, 2);
    assert_int_equal(attempt.occurrence_count, 2);
    assert_int_equal(attempt.occurrences[0].tool, PROBE);
    assert_int_equal(attempt.occurrences[1].error, 0);
}

static void a_loose_body_that_is_dropped_is_an_error(void **state) {
    (void)state;
    begin("[goal a]\ntake_out = all\n[error lost]\ndropped = yes\n");
    loose(0, LOOSE_HELD);
    output.events = EVENT_GRASPED;
    assert_int_equal(steps(1).errors, 0);
    for (int i = 1; i <= 2; i++) {
        output.events = EVENT_DROPPED;
        assert_int_equal(steps(1).errors, 1);
        output.events = 0;
        steps(100);
        assert_int_equal(attempt.errors, i);
    }
    output.events = EVENT_TAKEN_OUT;
    assert_int_equal(steps(1).errors, 0);
}

static void a_sentinel_error_ends_the_attempt(void **state) {
    (void)state;
    begin(FAR_GOAL "[error deep]\ndeep_mm = 2\nsentinel = yes\nfor_s = 0\n");
    touch(PROBE, "acl", landmark("acl_tibia"), 0, 2.5);
    assert_true(steps(1).ended);
    assert_int_equal(attempt.end, ATTEMPT_SENTINEL);
    assert_int_equal(attempt_verdict(&attempt, &task), VERDICT_NOT_YET);
    struct attempt before = attempt;
    steps(10);
    assert_memory_equal(&before, &attempt, sizeof attempt);
}

static void a_shaver_that_runs_on_cartilage_is_an_error(void **state) {
    (void)state;
    begin(FAR_GOAL "[error runs]\nrunning = yes\nnear_mm = 1\ngroups = femur tibia\n");
    vec3 at = landmark("plateau_medial");
    touch(SHAVER, "tibia", at, 0.9, 0);
    output.instruments[SHAVER].handle_validity = VALIDITY_OK;
    steps(50); // it stands
    output.instruments[SHAVER].handle.buttons = 1;
    touch(SHAVER, "tibia", at, 1.1, 0);
    steps(50); // it runs beside it
    assert_int_equal(attempt.errors, 0);
    touch(SHAVER, "tibia", at, 0.9, 0);
    steps(50);
    assert_int_equal(attempt.errors, 1);
}

static void a_tip_that_works_unseen_is_an_error(void **state) {
    (void)state;
    begin(FAR_GOAL "[error unseen]\nunseen = yes\nfor_s = 2\n");
    vec3 at = landmark("plateau_medial");
    pose seen = looking(vec3_add_scaled(at, 15, (vec3){0, 1, 0.5}), at);
    place(SCOPE, seen);
    touch(PROBE, "tibia", at, 5, 0);
    steps(300);
    assert_int_equal(attempt.errors, 0);
    place(SCOPE, looking(seen.translation, vec3_add(seen.translation, forward)));
    touch(PROBE, "tibia", at, 15.1, 0); // outside the knee
    steps(300);
    touch(PROBE, "tibia", at, 5, 0);
    steps(199);
    assert_int_equal(attempt.errors, 0);
    steps(3);
    assert_int_equal(attempt.errors, 1);
}

static void a_fast_tip_near_bone_is_an_error(void **state) {
    (void)state;
    begin(FAR_GOAL "[error fast]\nspeed_mm_s = 150\nnear_mm = 5\nfor_s = 0.1\n");
    vec3 at = landmark("plateau_medial");
    double speeds[] = {140, 170};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 100; i++) {
            double way = speeds[k] * 0.01 * i;
            touch(PROBE, "tibia", vec3_add(at, (vec3){way, 0, 0}), 3, 0);
            steps(1);
            assert_true(k == 1 || attempt.errors == 0);
        }
    assert_int_equal(attempt.errors, 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_error_counts_once_for_each_time),
        cmocka_unit_test(a_loose_body_that_is_dropped_is_an_error),
        cmocka_unit_test(a_sentinel_error_ends_the_attempt),
        cmocka_unit_test(a_shaver_that_runs_on_cartilage_is_an_error),
        cmocka_unit_test(a_tip_that_works_unseen_is_an_error),
        cmocka_unit_test(a_fast_tip_near_bone_is_an_error),
    };
    return cmocka_run_group_tests_name("attempt_errors", tests, make_case, drop_case);
}
