// Every key of a goal and of an error: met once, just missed, and at its bound under the noise of a
// tracker, where nothing comes twice, no seed changes the verdict, and a copy goes on with the same
// bytes.
#include "attempt_scenes.h"
#include "task/file_keys.h"

#include <stdio.h>
#include <string.h>

#define SEEDS 3

static void start(const struct kind *kind, bool is_error) {
    char text[1024];
    snprintf(text, sizeof text, "%s%s", is_error ? FAR_GOAL : "", kind->text);
    begin(text);
    femur_mm = 0;
}

// How often the last goal was met, or the error counted.
static int play(const struct kind *kind, bool is_error, double inside, uint64_t seed, int count) {
    struct attempt copy = {0};
    int came = 0;
    noise = (struct random){seed};
    trembles = seed != 0;
    attempt_init(&attempt);
    for (int tool = 0; tool < INSTRUMENT_COUNT; tool++)
        output.instruments[tool].present = false;
    output.step = 0;
    output.time_ns = 0;
    for (int i = 0; i < count; i++) {
        kind->set(inside);
        struct attempt_news news = steps(1);
        came += is_error ? news.errors & 1 : news.goals_met >> LAST & 1;
        if (i == count / 3)
            copy = attempt;
        else if (i > count / 3)
            attempt_step(&copy, site, &output);
    }
    assert_memory_equal(&copy, &attempt, sizeof copy);
    return came;
}

static int wrong; // rows of this test

static void check(const struct kind *kind, bool is_error, double inside, uint64_t seed, int most,
                  int least) {
    int came = play(kind, is_error, inside, seed, is_error ? 1200 : 500);
    if (came < least || came > most) {
        print_error("%s %s, inside by %g, noise %d: came %d times\n", is_error ? "error" : "goal",
                    kind->key, inside, (int)seed, came);
        wrong++;
    }
    if (!is_error)
        assert_int_equal(attempt.goals[LAST].met, came);
    else
        assert_int_equal(attempt.errors, came);
}

static void is_met_and_just_missed(const struct kind *kind, bool is_error) {
    start(kind, is_error);
    check(kind, is_error, kind->just, 0, 1, 1);
    check(kind, is_error, -kind->just, 0, 0, 0);
}

static void does_not_flicker(const struct kind *kind, bool is_error) {
    start(kind, is_error);
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        check(kind, is_error, kind->clear, seed, 1, 1);
        check(kind, is_error, 0, seed, 1, 1);
        check(kind, is_error, -kind->clear, seed, 0, 0);
        for (int i = 1; is_error && i <= 4; i++) // where it comes by noise alone
            check(kind, is_error, -0.12 * i * kind->clear, seed, 1, 0);
    }
}

// ---- tests --------------------------------------------------------------------------------------

static void every_goal_is_met_and_just_missed(void **state) {
    (void)state;
    wrong = 0;
    for (const struct kind *k = goal_kinds; k->key; k++)
        is_met_and_just_missed(k, false);
    assert_int_equal(wrong, 0);
}

static void every_error_is_made_and_just_not(void **state) {
    (void)state;
    wrong = 0;
    for (const struct kind *k = error_kinds; k->key; k++)
        is_met_and_just_missed(k, true);
    assert_int_equal(wrong, 0);
}

static void no_goal_flickers_by_noise(void **state) {
    (void)state;
    wrong = 0;
    for (const struct kind *k = goal_kinds; k->key; k++)
        does_not_flicker(k, false);
    assert_int_equal(wrong, 0);
}

static void no_error_flickers_by_noise(void **state) {
    (void)state;
    wrong = 0;
    for (const struct kind *k = error_kinds; k->key; k++)
        does_not_flicker(k, true);
    assert_int_equal(wrong, 0);
}

// The least distance that a task may ask for.
static void a_scope_that_rests_is_still_for_any_tracker(void **state) {
    (void)state;
    const struct kind rest = {"still_mm", "[goal a]\nsee = patella\nstill_mm = 0.5\nhold_s = 3\n",
                              NULL, 0, 0};
    start(&rest, false);
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        noise = (struct random){seed};
        trembles = true;
        attempt_init(&attempt);
        for (int i = 0; i < 330; i++) {
            stand_before(AWAY_MM);
            steps(1);
        }
        assert_int_equal(attempt.goals_met, 1);
    }
}

static bool has(const struct kind *kinds, const char *key) {
    while (kinds->key && strcmp(kinds->key, key))
        kinds++;
    return kinds->key;
}

static void assert_is_documented(const char *key) {
    static char text[1 << 17];
    char word[64];
    FILE *file = fopen(CASES "/README.md", "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    snprintf(word, sizeof word, "`%s`", key);
    if (!strstr(strstr(text, "## A task"), word))
        fail_msg("cases/README.md does not explain %s", key);
}

static void every_key_of_a_file_has_rows_and_is_documented(void **state) {
    (void)state;
    for (const struct setting_key *key = task_goal_keys(); key->name; key++) {
        assert_is_documented(key->name);
        if (!has(goal_kinds, key->name))
            fail_msg("[goal] %s has no row", key->name);
    }
    for (const struct setting_key *key = task_error_keys(); key->name; key++) {
        assert_is_documented(key->name);
        if (!has(error_kinds, key->name))
            fail_msg("[error] %s has no row", key->name);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_key_of_a_file_has_rows_and_is_documented),
        cmocka_unit_test(every_goal_is_met_and_just_missed),
        cmocka_unit_test(every_error_is_made_and_just_not),
        cmocka_unit_test(no_goal_flickers_by_noise),
        cmocka_unit_test(no_error_flickers_by_noise),
        cmocka_unit_test(a_scope_that_rests_is_still_for_any_tracker),
    };
    return cmocka_run_group_tests_name("attempt_kinds", tests, make_case, drop_case);
}
