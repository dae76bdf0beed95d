// What a report says first of a session: verdicts of attempts, then what was cut.

#include "base/clock.h"
#include "review/outcome.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct survey survey;
static char *page;

static int begin(void **state) {
    (void)state;
    memset(&survey, 0, sizeof survey);
    return 0;
}

static int end(void **state) {
    (void)state;
    free(page);
    page = NULL;
    return 0;
}

static void write_page(void) {
    size_t size;
    FILE *file = open_memstream(&page, &size);
    report_outcome(file, &survey, NULL);
    fclose(file);
}

static void assert_has(const char *text) {
    if (!strstr(page, text))
        fail_msg("no '%s' in '%s'", text, page);
}

static struct survey_attempt *attempt(const char *task, enum verdict verdict,
                                      enum attempt_end reason) {
    struct survey_attempt *a = &survey.attempts[survey.attempt_count++];
    a->begun.number = (uint32_t)survey.attempt_count;
    snprintf(a->begun.task, sizeof a->begun.task, "%s", task);
    a->ended = (struct trace_outcome){.number = a->begun.number,
                                      .end = reason,
                                      .verdict = verdict,
                                      .goals_met = 3,
                                      .time_ns = 95 * NS_PER_S};
    return a;
}

static void each_attempt_has_its_verdict_in_words(void **state) {
    (void)state;
    attempt("steady-camera", VERDICT_PASSED, ATTEMPT_DONE);
    struct survey_attempt *second = attempt("ring_transfer", VERDICT_NOT_YET, ATTEMPT_TIME_OUT);
    second->begun.purpose = ATTEMPT_EXAM;
    second->ended.errors = second->ended.goals_met = 1;
    write_page();
    assert_has("<strong>Steady camera</strong>: passed. 3 goals met, 0 errors, 95.0 s.<");
    assert_has("<strong>Ring transfer</strong> (exam): not yet passed. 1 goal met, 1 error, "
               "95.0 s, time over.<");
    assert_null(strstr(page, "Nothing was cut"));
}

static void attempts_come_before_cuts(void **state) {
    (void)state;
    attempt("radial-tear", VERDICT_PASSED, ATTEMPT_DONE);
    survey.tissues[0] = (struct tissue_figures){.mesh_number = 2, .cuts = 1};
    survey.tissues[0].quality.planned_mm3 = 100;
    survey.tissues[0].quality.under_mm3 = 40;
    survey.tissues[0].quality.over_mm3 = 7;
    write_page();
    assert_has("60.0 of 100.0 mm³ planned removed, 7.0 mm³ too much. Thinnest remaining rim 0.0 "
               "mm. 1 cut.<");
    assert_true(strstr(page, "Radial tear") < strstr(page, "60.0 of"));
}

static void an_attempt_whose_end_was_lost_is_told_as_such(void **state) {
    (void)state;
    attempt("palpation", VERDICT_OPEN, ATTEMPT_RUNS)->ended.number = 0;
    write_page();
    assert_has("<strong>Palpation</strong>: the record has no end of it.<");
}

static void what_the_survey_left_out_is_counted(void **state) {
    (void)state;
    for (int i = 0; i < SURVEY_ATTEMPTS_MAX; i++)
        attempt("palpation", VERDICT_PASSED, ATTEMPT_DONE);
    survey.attempt_count += 4;
    write_page();
    assert_has("<p>4 more attempts are in the trace.</p>");
}

static void without_both_nothing_was_cut(void **state) {
    (void)state;
    write_page();
    assert_has("Nothing was cut");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(each_attempt_has_its_verdict_in_words, begin, end),
        cmocka_unit_test_setup_teardown(attempts_come_before_cuts, begin, end),
        cmocka_unit_test_setup_teardown(an_attempt_whose_end_was_lost_is_told_as_such, begin, end),
        cmocka_unit_test_setup_teardown(what_the_survey_left_out_is_counted, begin, end),
        cmocka_unit_test_setup_teardown(without_both_nothing_was_cut, begin, end),
    };
    return cmocka_run_group_tests_name("review_outcome", tests, NULL, NULL);
}
