// The words that OpenIGTLink has for an attempt: each once, in order, and of an exam no result.

#include "igtl/attempt.h"
#include "test.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>

#define SECOND_NS 1000000000LL

static struct igtl_attempt now;
static struct igtl_attempt_told told;

static int begin(void **state) {
    (void)state;
    told = (struct igtl_attempt_told){.figures = false};
    now = (struct igtl_attempt){.number = 2,
                                .task = "telescoping",
                                .time_s = 1.26,
                                .limit_s = 120,
                                .goal_count = 2,
                                .error_count = 1,
                                .goals = {{.name = "near"}, {.name = "far"}},
                                .errors = {{.name = "bump"}}};
    return 0;
}

// What is told, joined: happenings as they are, figures as "{}".
static const char *telling(int64_t utc_ns, char last_figures[IGTL_TEXT_SIZE]) {
    static char all[1024];
    struct igtl_attempt_word word;
    all[0] = '\0';
    while (igtl_attempt_next(&told, &now, utc_ns, &word)) {
        bool figures = !strcmp(word.device, IGTL_PROGRESS);
        assert_true(figures || !strcmp(word.device, IGTL_ATTEMPT));
        snprintf(all + strlen(all), sizeof all - strlen(all), "%s%s", all[0] ? "|" : "",
                 figures ? "{}" : word.text);
        if (figures && last_figures)
            memcpy(last_figures, word.text, IGTL_TEXT_SIZE);
    }
    return all;
}

static void each_happening_is_told_once_with_the_figures_behind(void **state) {
    (void)state;
    assert_string_equal(telling(0, NULL), "begun telescoping|{}");
    assert_string_equal(telling(1, NULL), "");
    now.goals[1].met = true;
    now.errors[0].count = 2;
    assert_string_equal(telling(2, NULL), "goal far|error bump 2|{}");
    assert_string_equal(telling(3, NULL), "");
    now.goals[0].met = true;
    now.ended = true;
    now.end = ATTEMPT_TIME_OUT;
    now.verdict = VERDICT_NOT_YET;
    assert_string_equal(telling(4, NULL), "goal near|ended not yet (time out)|{}");
    assert_string_equal(telling(5, NULL), "");
    now.number++;
    now.ended = now.goals[0].met = now.goals[1].met = false;
    now.errors[0].count = 0;
    assert_string_equal(telling(6, NULL), "begun telescoping|{}");
    now.number = 0;
    assert_string_equal(telling(7, NULL), "");
    now.number = 3; // of another session
    assert_string_equal(telling(8, NULL), "begun telescoping|{}");
}

static void figures_come_each_second_after_the_end_too(void **state) {
    (void)state;
    telling(0, NULL);
    assert_string_equal(telling(SECOND_NS - 1, NULL), "");
    assert_string_equal(telling(SECOND_NS, NULL), "{}");
    now.ended = true;
    telling(SECOND_NS + 1, NULL);
    assert_string_equal(telling(2 * SECOND_NS, NULL), "");
    assert_string_equal(telling(2 * SECOND_NS + 1, NULL), "{}");
    assert_string_equal(telling(-SECOND_NS, NULL), "{}"); // somebody has set the PC's time
}

static void what_nobody_watched_is_not_told_later(void **state) {
    (void)state;
    now.goals[0].met = true;
    told.last = now;
    assert_string_equal(telling(0, NULL), "{}");
    now.goals[1].met = true;
    assert_string_equal(telling(1, NULL), "goal far|{}");
}

// The server that was killed has lost its last milliseconds.
static void what_is_undone_is_told_when_it_happens_again(void **state) {
    (void)state;
    now.goals[0].met = now.ended = true;
    now.errors[0].count = 3;
    telling(0, NULL);
    now.goals[0].met = now.ended = false;
    now.errors[0].count = 2;
    assert_string_equal(telling(1, NULL), "");
    now.goals[0].met = true;
    now.errors[0].count = 3;
    assert_string_equal(telling(2, NULL), "goal near|error bump 3|{}");
}

static json_t *figures(int64_t utc_ns) {
    char text[IGTL_TEXT_SIZE] = "";
    telling(utc_ns, text);
    json_t *read = json_loads(text, 0, NULL);
    if (!read)
        fail_msg("no JSON: %s", text);
    return read;
}

static void figures_are_json(void **state) {
    (void)state;
    now.goals[0].met = true;
    now.errors[0].count = 4;
    json_t *read = figures(0);
    json_t *expected = json_pack("{s:i, s:s, s:s, s:s, s:i, s:b, s:f, s:i, s:i, s:i, s:s, s:s}",
                                 "number", 2, "task", "telescoping", "purpose", "practice", "hand",
                                 "right", "limit_s", 120, "ended", 0, "time_s", 1.3, "goals", 2,
                                 "goals_met", 1, "errors", 4, "end", "runs", "verdict", "open");
    assert_true(json_equal(read, expected));
    json_decref(read);
    now.goal_count = now.error_count = 0; // not known, as in a record without its case
    now.time_s = NAN;
    read = figures(SECOND_NS);
    for (const char *const *key =
             (const char *const[]){"time_s", "goals", "goals_met", "errors", NULL};
         *key; key++) {
        assert_non_null(json_object_get(expected, *key));
        json_object_del(expected, *key);
    }
    assert_true(json_equal(read, expected));
    json_decref(read);
    json_decref(expected);
}

static void an_exam_tells_nothing_of_how_it_goes(void **state) {
    (void)state;
    char text[IGTL_TEXT_SIZE];
    now.purpose = ATTEMPT_EXAM;
    now.goals[0].met = true;
    now.errors[0].count = 4;
    assert_string_equal(telling(0, text), "begun telescoping|{}");
    assert_string_equal(text, "{\"number\":2,\"task\":\"telescoping\",\"purpose\":\"exam\","
                              "\"hand\":\"right\",\"limit_s\":120,\"ended\":false,\"time_s\":1.3}");
    now.ended = true;
    now.end = ATTEMPT_SENTINEL;
    now.verdict = VERDICT_NOT_YET;
    assert_string_equal(telling(1, text), "ended|{}");
    assert_string_equal(text, "{\"number\":2,\"task\":\"telescoping\",\"purpose\":\"exam\","
                              "\"hand\":\"right\",\"limit_s\":120,\"ended\":true}");
}

static void the_longest_figures_are_whole(void **state) {
    (void)state;
    memset(now.task, 'n', IGTL_TASK_NAME_SIZE - 1);
    now.number = UINT32_MAX;
    now.time_s = 1152921504.6; // WIRE_TIME_MAX_NS
    now.limit_s = -1.234567891e-300;
    now.goal_count = IGTL_GOALS_MAX;
    for (int i = 0; i < IGTL_GOALS_MAX; i++)
        now.goals[i].met = true;
    now.errors[0].count = UINT32_MAX;
    now.ended = true;
    now.end = ATTEMPT_SENTINEL;
    now.verdict = VERDICT_NOT_YET;
    json_t *read = figures(0);
    assert_string_equal(json_string_value(json_object_get(read, "verdict")), "not yet");
    json_decref(read);
}

#define TEST(name) cmocka_unit_test_setup(name, begin)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(each_happening_is_told_once_with_the_figures_behind),
        TEST(figures_come_each_second_after_the_end_too),
        TEST(what_nobody_watched_is_not_told_later),
        TEST(what_is_undone_is_told_when_it_happens_again),
        TEST(figures_are_json),
        TEST(an_exam_tells_nothing_of_how_it_goes),
        TEST(the_longest_figures_are_whole),
    };
    return cmocka_run_group_tests_name("igtl_attempt", tests, NULL, NULL);
}
