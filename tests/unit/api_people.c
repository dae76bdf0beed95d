// What /api/v1 changes of people, courses and sessions that are there, and who is signed out by it.
#include "test.h"
#include "unit/api_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct error err;
static const char *grace;

static int begin(void **state) {
    api_begin(state);
    grace = token_of("grace");
    return 0;
}

static bool is_in(const char *token) {
    int status = ask("GET", "/me", token, NULL);
    assert_true(status == 200 || status == 401);
    return status == 200;
}

static void assert_audited(const char *action, const char *subject) {
    assert_int_equal(ask("GET", "/audit?limit=1", grace, NULL), 200);
    assert_string_equal(text_at("audit.0.actor"), "grace");
    assert_string_equal(text_at("audit.0.action"), action);
    assert_string_equal(text_at("audit.0.subject"), subject);
}

// ---- people -------------------------------------------------------------------------------------

static void a_full_name_is_given_changed_and_taken_away_later(void **state) {
    (void)state;
    static const char *const bodies[] = {"{\"full_name\":\"Eve A.\"}", "{\"full_name\":\"Eve B.\"}",
                                         "{\"full_name\":null}"};
    static const char *const names[] = {"Eve A.", "Eve B.", "(none)"};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(ask("PATCH", "/trainees/eve", grace, bodies[i]), 204);
        assert_audited("full name", "trainee 2");
        assert_int_equal(ask("GET", "/trainees", grace, NULL), 200);
        assert_string_equal(text_at("trainees.1.full_name"), names[i]);
        assert_string_equal(text_at("trainees.1.name"), "eve");
    }
}

static void a_renamed_trainee_keeps_sessions_courses_and_account(void **state) {
    (void)state;
    const char *account = token_of("ada.l");
    assert_int_equal(ask("PATCH", "/trainees/ada", grace, "{\"name\":\"ada.byron\"}"), 204);
    assert_audited("rename", "trainee 1");
    assert_int_equal(ask("GET", "/me", account, NULL), 200);
    assert_string_equal(text_at("account.trainee"), "ada.byron");
    assert_string_equal(text_at("courses.0"), "autumn");
    assert_int_equal(ask("GET", "/sessions", account, NULL), 200);
    assert_string_equal(text_at("sessions.0.id"), SESSION_ADA);
    assert_string_equal(text_at("sessions.0.trainee"), "ada.byron");
    assert_int_equal(ask("PATCH", "/trainees/ada", grace, "{\"name\":\"x\"}"), 404);
}

static void a_trainee_without_sessions_is_removed_and_one_with_is_not(void **state) {
    (void)state;
    assert_int_equal(ask("POST", "/trainees", grace, "{\"name\":\"typo\"}"), 201);
    assert_int_equal(ask("POST", "/courses/autumn/trainees", grace, "{\"trainee\":\"typo\"}"), 204);
    const char *code = token_of_code("typo");
    assert_int_equal(ask("DELETE", "/trainees/typo", grace, NULL), 204);
    assert_audited("remove", "trainee 3");
    assert_false(is_in(code));
    assert_int_equal(ask("GET", "/courses/autumn", grace, NULL), 200);
    assert_int_equal(json_array_size(json_object_get(json_object_get(said, "course"), "trainees")),
                     1);
    assert_int_equal(ask("DELETE", "/trainees/ada", grace, NULL), 409);
    assert_non_null(strstr(text_at("error.text"), "erase"));
    assert_int_equal(ask("GET", "/trainees", grace, NULL), 200);
    assert_int_equal(count_at("trainees"), 2);
}

static void an_erased_trainee_is_a_pseudonym_with_sessions(void **state) {
    (void)state;
    char pseudonym[STORE_NAME_MAX], path[128];
    const char *tokens[] = {token_of("ada.l"), token_of_code("ada")};
    assert_int_equal(ask("POST", "/trainees/ada/erase", grace, "{}"), 200);
    snprintf(pseudonym, sizeof pseudonym, "%s", text_at("pseudonym"));
    assert_int_equal(strncmp(pseudonym, "erased-", 7), 0);
    assert_int_equal(count_at("sessions"), 1);
    assert_string_equal(text_at("sessions.0"), SESSION_ADA);
    assert_audited("erase", "trainee 1");
    assert_false(is_in(tokens[0]) || is_in(tokens[1]));
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA, grace, NULL), 200);
    assert_string_equal(text_at("session.trainee"), pseudonym);
    snprintf(path, sizeof path, "/trainees/%s", pseudonym);
    assert_int_equal(ask("PATCH", path, grace, "{\"name\":\"ada\"}"), 404);
}

static void a_renamed_account_stays_signed_in(void **state) {
    (void)state;
    const char *tom = token_of("tom");
    assert_int_equal(ask("PATCH", "/accounts/tom", tom, "{\"name\":\"thomas\"}"), 204);
    assert_int_equal(ask("GET", "/me", tom, NULL), 200);
    assert_string_equal(text_at("account.name"), "thomas");
    assert_int_equal(ask("PATCH", "/accounts/tom", grace, "{\"name\":\"x\"}"), 404);
    assert_int_equal(ask("PATCH", "/accounts/thomas", grace,
                         "{\"name\":\"tom\",\"role\":\"instructor\",\"password\":\"0123456789\"}"),
                     204);
    assert_false(is_in(tom));
    assert_int_equal(ask("GET", "/accounts", grace, NULL), 200);
    assert_string_equal(text_at("accounts.1.name"), "tom");
    assert_string_equal(text_at("accounts.1.role"), "instructor");
}

// ---- courses, sessions --------------------------------------------------------------------------

static void a_course_is_renamed_emptied_and_removed(void **state) {
    (void)state;
    assert_int_equal(ask("PATCH", "/courses/autumn", grace, "{\"name\":\"autumn-2026\"}"), 204);
    assert_audited("rename", "course 1");
    assert_int_equal(ask("DELETE", "/courses/autumn-2026/trainees/ada", grace, NULL), 204);
    assert_audited("unenrol", "trainee 1");
    assert_int_equal(ask("GET", "/me", token_of("ada.l"), NULL), 200);
    assert_int_equal(count_at("courses"), 0);
    assert_int_equal(ask("POST", "/courses/autumn-2026/trainees", grace, "{\"trainee\":\"ada\"}"),
                     204);
    assert_int_equal(ask("DELETE", "/courses/autumn-2026", grace, NULL), 204);
    assert_audited("remove", "course 1");
    assert_int_equal(ask("GET", "/courses/autumn-2026", grace, NULL), 404);
    assert_int_equal(ask("GET", "/trainees", grace, NULL), 200);
    assert_int_equal(count_at("trainees"), 2);
}

static void a_removed_session_is_gone_with_results_and_trace(void **state) {
    (void)state;
    assert_int_equal(access(in_api("1.trace"), F_OK), 0);
    assert_int_equal(ask("DELETE", "/sessions/" SESSION_ADA, grace, NULL), 204);
    assert_audited("remove", "session " SESSION_ADA);
    assert_int_not_equal(access(in_api("1.trace"), F_OK), 0);
    assert_int_equal(access(in_api("2.trace"), F_OK), 0);
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA, grace, NULL), 404);
    assert_int_equal(ask("GET", "/distributions?case=healthy", grace, NULL), 200);
    assert_int_equal((int)number_at("distributions.0.n"), 1);
    assert_int_equal(ask("DELETE", "/sessions/" SESSION_ADA, grace, NULL), 404);
}

static void an_open_session_and_one_whose_trace_stays_are_kept(void **state) {
    (void)state;
    struct store *store = api_store();
    struct store_session s = {.start_utc_ns = 1, .part = 1, .state = STATE_OPEN, .case_hash = 7};
    snprintf(s.id, sizeof s.id, "%032d", 4);
    snprintf(s.station, sizeof s.station, "room-2");
    snprintf(s.case_name, sizeof s.case_name, "torn");
    snprintf(s.trace, sizeof s.trace, "%s", api_dir); // a folder cannot be unlinked
    assert_int_equal(store_put_session(store, &s, NULL, 0, &err), RESULT_OK);
    assert_int_equal(ask("DELETE", "/sessions/00000000000000000000000000000004", grace, NULL), 409);
    s.state = STATE_CLOSED;
    assert_int_equal(store_put_session(store, &s, NULL, 0, &err), RESULT_OK);
    store_close(&store);
    assert_int_equal(ask("DELETE", "/sessions/00000000000000000000000000000004", grace, NULL), 500);
    assert_null(strstr(answer.body, api_dir));
    assert_int_equal(ask("GET", "/sessions/00000000000000000000000000000004", grace, NULL), 200);
}

// ---- signing out everywhere ---------------------------------------------------------------------

static void one_signs_out_everywhere(void **state) {
    (void)state;
    const char *here = token_of("tom"), *there = token_of("tom");
    assert_int_equal(ask("POST", "/me/sign-out", here, "{}"), 204);
    assert_non_null(strstr(answer.cookie, "Max-Age=0"));
    assert_false(is_in(here) || is_in(there));
    assert_true(is_in(grace));
    const char *code = token_of_code("ada");
    assert_int_equal(ask("POST", "/me/sign-out", code, "{}"), 204);
    assert_false(is_in(code));
}

static void an_instructor_signs_others_out(void **state) {
    (void)state;
    const char *tom = token_of("tom"), *ada = token_of("ada.l"), *code = token_of_code("ada");
    assert_int_equal(ask("POST", "/accounts/tom/sign-out", grace, "{}"), 204);
    assert_audited("sign out", "account 2");
    assert_false(is_in(tom));
    assert_true(is_in(ada) && is_in(code));
    assert_int_equal(ask("POST", "/trainees/ada/sign-out", grace, "{}"), 204);
    assert_audited("sign out", "trainee 1");
    assert_false(is_in(ada) || is_in(code));
    assert_true(is_in(grace));
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, api_end)
        TEST(a_full_name_is_given_changed_and_taken_away_later),
        TEST(a_renamed_trainee_keeps_sessions_courses_and_account),
        TEST(a_trainee_without_sessions_is_removed_and_one_with_is_not),
        TEST(an_erased_trainee_is_a_pseudonym_with_sessions),
        TEST(a_renamed_account_stays_signed_in),
        TEST(a_course_is_renamed_emptied_and_removed),
        TEST(a_removed_session_is_gone_with_results_and_trace),
        TEST(an_open_session_and_one_whose_trace_stays_are_kept),
        TEST(one_signs_out_everywhere),
        TEST(an_instructor_signs_others_out),
    };
    return cmocka_run_group_tests_name("api_people", tests, NULL, NULL);
}
