// The statement of an attempt, from the records to the file.

#include "store/attempts.h"
#include "test.h"
#include "unit/store_files.h"
#include "xapi/words.h"
#include "xapi/xapi.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define ADA "00000000000000000000000000000001"
#define SITE "https://training.example.org/arthron"

static struct store *store;
static struct error err;
static bool is_new;
static char path[FOLDER_MAX + 32];

static int begin(void **state) {
    store_folder_begin(state);
    store = open_records();
    struct store_session ada = a_session(1);
    assert_ok(store_put_session(store, &ada, NULL, 0, &err));
    assert_ok(store_add_course(store, "autumn 26", &err));
    assert_ok(store_enrol(store, "ada", "autumn 26", &err));
    snprintf(path, sizeof path, "%s.jsonl", store_path);
    return 0;
}

static int end(void **state) {
    store_close(&store);
    return store_folder_end(state);
}

// What the server writes of this attempt; NULL: nothing. The caller releases it.
static json_t *written(const struct attempt_row *row, bool names) {
    struct xapi_settings settings = {.site = SITE, .names = names};
    struct xapi *xapi;
    snprintf(settings.file, sizeof settings.file, "%s", path);
    unlink(path);
    assert_ok(store_attempt_add(store, row, &is_new, &err));
    assert_ok(xapi_start(&settings, &xapi, &err));
    xapi_attempt_told(xapi, store, row->session, row->number);
    xapi_stop(&xapi);
    return json_load_file(path, JSON_DISABLE_EOF_CHECK, NULL);
}

static const char *text_at(json_t *statement, const char *a, const char *b, const char *c) {
    json_t *at = json_object_get(statement, a);
    if (b)
        at = json_object_get(at, b);
    if (c)
        at = json_object_get(at, c);
    assert_true(json_is_string(at));
    return json_string_value(at);
}

static void a_passed_attempt_is_a_statement_with_its_score(void **state) {
    (void)state;
    struct attempt_row row = an_attempt(ADA, 7);
    json_t *s = written(&row, false), *result = json_object_get(s, "result");
    assert_string_equal(text_at(s, "id", NULL, NULL), "f87270f9-217e-5f57-9447-d69ef88c502b");
    assert_string_equal(text_at(s, "actor", "account", "homePage"), SITE);
    assert_string_equal(text_at(s, "actor", "account", "name"), "trainee-1");
    assert_string_equal(text_at(s, "verb", "id", NULL), "http://adlnet.gov/expapi/verbs/passed");
    assert_string_equal(text_at(s, "object", "id", NULL), SITE "/tasks/centring");
    assert_string_equal(text_at(s, "result", "duration", NULL), "PT40.00S");
    assert_true(json_is_true(json_object_get(result, "success")));
    assert_true(json_is_true(json_object_get(result, "completion")));
    json_t *score = json_object_get(result, "score");
    assert_near(json_number_value(json_object_get(score, "scaled")), 1, 0);
    assert_near(json_number_value(json_object_get(score, "raw")), 4, 0);
    assert_near(json_number_value(json_object_get(score, "max")), 4, 0);
    json_t *courses = json_object_get(
        json_object_get(json_object_get(s, "context"), "contextActivities"), "grouping");
    assert_string_equal(text_at(json_array_get(courses, 0), "id", NULL, NULL),
                        SITE "/courses/autumn%2026");
    json_t *where = json_object_get(json_object_get(json_object_get(s, "context"), "extensions"),
                                    SITE "/xapi/session");
    assert_string_equal(text_at(where, "session", NULL, NULL), ADA);
    assert_int_equal(json_integer_value(json_object_get(where, "task_version")), 1);
    json_decref(s);
}

static void nobody_is_named_unless_the_config_says_so(void **state) {
    (void)state;
    struct attempt_row row = an_attempt(ADA, 1);
    json_t *s = written(&row, false);
    char *text = json_dumps(s, 0);
    assert_null(strstr(text, "ada"));
    free(text);
    json_decref(s);
    s = written(&row, true);
    assert_string_equal(text_at(s, "actor", "account", "name"), "ada");
    json_decref(s);
}

static void an_attempt_that_was_left_failed_and_is_not_complete(void **state) {
    (void)state;
    struct attempt_row row = an_attempt(ADA, 2);
    row.goals_met = 1;
    snprintf(row.verdict, sizeof row.verdict, "not yet");
    snprintf(row.end, sizeof row.end, "left");
    json_t *s = written(&row, false), *result = json_object_get(s, "result");
    assert_string_equal(text_at(s, "verb", "display", "en"), "failed");
    assert_true(json_is_false(json_object_get(result, "success")));
    assert_true(json_is_false(json_object_get(result, "completion")));
    assert_near(json_number_value(json_object_get(json_object_get(result, "score"), "scaled")),
                0.25, 1e-12);
    json_decref(s);
}

static void an_exam_that_is_not_released_says_nothing(void **state) {
    (void)state;
    struct attempt_row row = an_attempt(ADA, 3);
    snprintf(row.purpose, sizeof row.purpose, "exam");
    json_t *s = written(&row, false);
    assert_null(s);
}

static void the_same_attempt_has_the_same_id_and_another_one_another(void **state) {
    (void)state;
    char first[37], again[37];
    // python: uuid.uuid5(uuid.UUID("01234567-89ab-4def-8123-456789abcdef"), "attempt 7")
    xapi_attempt_uuid("0123456789abcdef0123456789abcdef", 7, first);
    assert_string_equal(first, "8cd3da04-d90b-50aa-8d32-834706c80ae0");
    xapi_attempt_uuid("0123456789abcdef0123456789abcdef", 8, again);
    assert_string_not_equal(first, again);
}

static void a_wrong_site_is_refused(void **state) {
    (void)state;
    const struct xapi_settings settings = {.file = "/dev/null", .site = "ftp://a"};
    struct xapi *xapi;
    assert_int_equal(xapi_start(&settings, &xapi, &err), RESULT_INVALID);
    assert_null(xapi);
    assert_non_null(strstr(err.text, "ftp://a"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_passed_attempt_is_a_statement_with_its_score, begin, end),
        cmocka_unit_test_setup_teardown(nobody_is_named_unless_the_config_says_so, begin, end),
        cmocka_unit_test_setup_teardown(an_attempt_that_was_left_failed_and_is_not_complete, begin,
                                        end),
        cmocka_unit_test_setup_teardown(an_exam_that_is_not_released_says_nothing, begin, end),
        cmocka_unit_test(the_same_attempt_has_the_same_id_and_another_one_another),
        cmocka_unit_test(a_wrong_site_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
