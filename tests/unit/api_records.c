// What /api/v1 tells of records and people, and to whom.
#include "test.h"
#include "unit/api_files.h"
#include "unit/case_knee.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct error err;

// ---- one's own ----------------------------------------------------------------------------------

static void a_trainee_sees_no_session_but_their_own(void **state) {
    (void)state;
    static const char *const ids[] = {SESSION_ADA, SESSION_EVE, SESSION_NOBODY};
    static const char *const parts[] = {"", "/trace", "/report"};
    const char *tokens[] = {token_of("grace"), token_of("ada.l"), token_of_code("ada")};
    for (int who = 0; who < 3; who++)
        for (int i = 0; i < 3; i++)
            for (int part = 0; part < 3; part++) {
                char path[96];
                snprintf(path, sizeof path, "/sessions/%s%s", ids[i], parts[part]);
                assert_int_equal(ask("GET", path, tokens[who], NULL), !who || !i ? 200 : 404);
                if (answer.status == 404) { // as if there were none
                    assert_string_equal(text_at("error.text"), "There is no such session.");
                    assert_string_equal(answer.file, "");
                }
            }
}

static void a_list_of_a_trainee_has_their_own_sessions_whatever_is_asked_for(void **state) {
    (void)state;
    static const char *const queries[] = {"", "?trainee=ada", "?course=autumn",
                                          "?case=healthy&limit=1"};
    static const char *const before_none[] = {"?before=" SESSION_EVE, "?before=" SESSION_NOBODY,
                                              "?before=ffffffffffffffffffffffffffffffff"};
    const char *tokens[] = {token_of("ada.l"), token_of_code("ada")};
    for (int who = 0; who < 2; who++)
        for (size_t i = 0; i < sizeof queries / sizeof *queries; i++) {
            char path[96];
            snprintf(path, sizeof path, "/sessions%s", queries[i]);
            assert_int_equal(ask("GET", path, tokens[who], NULL), 200);
            assert_int_equal(count_at("sessions"), 1);
            assert_string_equal(text_at("sessions.0.id"), SESSION_ADA);
            assert_true(json_is_null(json_object_get(said, "next")));
        }
    for (int i = 0; i < 3; i++) { // another's is as one that does not exist
        char path[96];
        snprintf(path, sizeof path, "/sessions%s", before_none[i]);
        assert_int_equal(ask("GET", path, tokens[0], NULL), 200);
        assert_int_equal(count_at("sessions"), 0);
    }
    assert_int_equal(ask("GET", "/sessions?trainee=eve", tokens[0], NULL), 200);
    assert_int_equal(count_at("sessions"), 0);
    assert_int_equal(ask("GET", "/sessions?trainee=%65ve&limit=500", token_of("grace"), NULL), 200);
    assert_string_equal(text_at("sessions.0.id"), SESSION_EVE);
    assert_int_equal(count_at("sessions"), 1);
}

// An account whose trainee nobody named is nobody's, not that of sessions without a trainee.
static void an_account_of_no_trainee_has_no_sessions(void **state) {
    (void)state;
    struct store *store = api_store();
    assert_int_equal(store_add_account(store, "guest", ROLE_TRAINEE, NO_PASSWORD, NULL, &err),
                     RESULT_OK);
    store_close(&store);
    const char *token = token_of("guest");
    assert_int_equal(ask("GET", "/sessions", token, NULL), 200);
    assert_int_equal(count_at("sessions"), 0);
    assert_int_equal(ask("GET", "/sessions/" SESSION_NOBODY, token, NULL), 404);
}

// ---- sessions -----------------------------------------------------------------------------------

static void sessions_come_newest_first_and_page_by_page(void **state) {
    (void)state;
    const char *token = token_of("grace");
    assert_int_equal(ask("GET", "/sessions?limit=2", token, NULL), 200);
    assert_int_equal(count_at("sessions"), 2);
    assert_string_equal(text_at("sessions.0.id"), SESSION_NOBODY);
    assert_string_equal(text_at("sessions.1.id"), SESSION_EVE);
    assert_string_equal(text_at("next"), SESSION_EVE);
    assert_string_equal(text_at("sessions.0.trainee"), "(none)");
    assert_null(strstr(answer.body, api_dir));
    assert_int_equal(ask("GET", "/sessions?limit=2&before=" SESSION_EVE, token, NULL), 200);
    assert_int_equal(count_at("sessions"), 1);
    assert_string_equal(text_at("next"), "(none)");
    assert_near(number_at("sessions.0.start_utc_s"), 1001, 1e-9);
    assert_near(number_at("sessions.0.end_utc_s"), 1061, 1e-9);
    assert_string_equal(text_at("sessions.0.case_hash"), "0000000000000007");
}

static void a_session_comes_with_its_results(void **state) {
    (void)state;
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA, token_of("ada.l"), NULL), 200);
    assert_string_equal(text_at("session.id"), SESSION_ADA);
    assert_int_equal(count_at("results"), 2);
    assert_string_equal(text_at("results.0.metric"), "rim");
    assert_true(isnan(number_at("results.0.value")));
    assert_string_equal(text_at("results.1.metric"), "time");
    assert_near(number_at("results.1.value"), 61, 0);
    assert_near(number_at("results.1.version"), 1, 0);
    json_t *results = json_object_get(said, "results");
    assert_false(json_is_true(json_object_get(json_array_get(results, 0), "below_floor")));
    assert_true(json_is_true(json_object_get(json_array_get(results, 1), "below_floor")));
    assert_null(strstr(answer.body, api_dir));
}

static void a_trace_is_a_file_and_a_report_a_page(void **state) {
    (void)state;
    const char *token = token_of("ada.l");
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA "/trace", token, NULL), 200);
    assert_string_equal(answer.file, in_api("1.trace"));
    assert_string_equal(answer.download, SESSION_ADA ".trace");
    assert_string_equal(answer.type, "application/octet-stream");
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA "/report", token, NULL), 200);
    assert_string_equal(answer.type, "text/html; charset=utf-8");
    assert_true(answer.stands_alone);
    assert_memory_equal(answer.body, "<p>trace of " SESSION_ADA " beside autumn, if many</p>",
                        answer.size);
    write_file(api_dir, "1.trace", "bad", 3);
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA "/report", token, NULL), 500);
    assert_null(strstr(answer.body, api_dir));
    unlink(in_api("1.trace"));
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA "/report", token, NULL), 404);
    assert_int_equal(ask("GET", "/sessions/" SESSION_ADA "/trace", token, NULL), 404);
    assert_string_equal(answer.file, "");
}

static void a_course_is_exported_as_a_zip(void **state) {
    (void)state;
    const char *token = token_of("grace");
    static const struct {
        const char *path, *field;
        int status;
    } rows[] = {
        {"/courses/spring/export", "(none)", 404},
        {"/courses/autumn/export?from=yesterday", "from", 400},
        {"/courses/autumn/export?to=-1", "to", 400},
        {"/courses/autumn/export?names=yes", "(none)", 400},
    };
    assert_int_equal(
        ask("GET", "/courses/autumn/export?task=steady&from=0&to=1700000000.5", token, NULL), 200);
    assert_string_equal(answer.type, "application/zip");
    assert_string_equal(answer.download, "attempts.zip");
    assert_memory_equal(answer.body, "PK\3\4", 4);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(ask("GET", rows[i].path, token, NULL), rows[i].status);
        assert_string_equal(error_field(), rows[i].field);
    }
    assert_int_equal(ask("GET", "/audit?limit=9", token, NULL), 200);
    assert_non_null(strstr(answer.body, "attempts of course autumn"));
}

static void a_report_is_beside_a_course_of_ones_own(void **state) {
    (void)state;
    static const struct {
        const char *account, *path;
        int status;
        const char *beside;
    } rows[] = {
        {"grace", SESSION_ADA "/report", 200, "beside all<"},
        {"grace", SESSION_ADA "/report?course=winter", 200, "beside winter<"},
        {"grace", SESSION_EVE "/report", 200, "beside all<"},
        {"ada.l", SESSION_ADA "/report", 200, "beside autumn, if many<"},
        {"ada.l", SESSION_ADA "/report?course=autumn", 200, "beside autumn, if many<"},
        {"ada.l", SESSION_ADA "/report?course=winter", 404, ""},
        {"eve.l", SESSION_EVE "/report", 200, "beside nobody, if many<"},
        {"ada.l", SESSION_ADA "/report?with=autumn", 400, ""},
    };
    struct store *store = api_store();
    assert_int_equal(store_add_account(store, "eve.l", ROLE_TRAINEE, NO_PASSWORD, "eve", &err),
                     RESULT_OK);
    store_close(&store);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char path[96];
        snprintf(path, sizeof path, "/sessions/%s", rows[i].path);
        assert_int_equal(ask("GET", path, token_of(rows[i].account), NULL), rows[i].status);
        assert_non_null(memmem(answer.body, answer.size, rows[i].beside, strlen(rows[i].beside)));
    }
}

// ---- distributions ------------------------------------------------------------------------------

static void put_sessions(int count) {
    struct store *store = api_store();
    for (int i = 0; i < count; i++) {
        struct store_session s = {.start_utc_ns = 1, .part = 1, .state = STATE_CLOSED};
        struct store_result result = {"path", "probe", 1, "mm", (i * 7) % count, ""};
        snprintf(s.id, sizeof s.id, "%032x", 0x1000 + i);
        snprintf(s.station, sizeof s.station, "room-1");
        snprintf(s.trainee, sizeof s.trainee, "%s", i % 2 ? "ada" : "eve");
        snprintf(s.case_name, sizeof s.case_name, "many");
        snprintf(s.trace, sizeof s.trace, "/none");
        assert_int_equal(store_put_session(store, &s, &result, 1, &err), RESULT_OK);
    }
    store_close(&store);
}

static void distributions_have_values_and_no_names(void **state) {
    (void)state;
    const char *token = token_of("grace");
    assert_int_equal(ask("GET", "/distributions?case=healthy", token, NULL), 200);
    assert_int_equal(count_at("distributions"), 1);
    assert_string_equal(text_at("distributions.0.metric"), "time");
    assert_near(number_at("distributions.0.n"), 2, 0);
    assert_near(number_at("distributions.0.values.0"), 61, 0);
    assert_near(number_at("distributions.0.values.1"), 62, 0);
    assert_null(strstr(answer.body, "ada"));
    assert_int_equal(ask("GET", "/distributions?case=healthy&course=autumn", token, NULL), 200);
    assert_near(number_at("distributions.0.n"), 1, 0);
    put_sessions(401);
    assert_int_equal(ask("GET", "/distributions?case=many", token, NULL), 200);
    assert_near(number_at("distributions.0.n"), 401, 0);
    assert_true(isnan(number_at("distributions.0.values.0")));
    for (int i = 0; i < 21; i++) {
        char path[48];
        snprintf(path, sizeof path, "distributions.0.quantiles.%d", i);
        assert_near(number_at(path), 20.0 * i, 1e-9); // of 0 to 400, each once
    }
}

static void a_trainee_sees_distributions_of_their_own_courses(void **state) {
    (void)state;
    const char *token = token_of("ada.l");
    assert_int_equal(ask("GET", "/distributions?case=healthy&course=autumn", token, NULL), 200);
    assert_int_equal(ask("GET", "/distributions?case=healthy&course=winter", token, NULL), 404);
    assert_int_equal(ask("GET", "/distributions?case=healthy&course=none", token, NULL), 404);
    assert_int_equal(ask("GET", "/distributions?case=healthy", token, NULL), 400);
    assert_string_equal(error_field(), "course");
}

// A session of this person on the case many; its one figure is its number.
static void put_session_of(const char *trainee, int number) {
    struct store *store = api_store();
    struct store_session s = {.start_utc_ns = 1, .part = 1, .state = STATE_CLOSED};
    struct store_result result = {"path", "probe", 1, "mm", number, ""};
    snprintf(s.id, sizeof s.id, "%032x", 0x2000 + number);
    snprintf(s.station, sizeof s.station, "room-1");
    snprintf(s.trainee, sizeof s.trainee, "%s", trainee);
    snprintf(s.case_name, sizeof s.case_name, "many");
    snprintf(s.trace, sizeof s.trace, "/none");
    assert_int_equal(store_put_session(store, &s, &result, 1, &err), RESULT_OK);
    store_close(&store);
}

static void enrol(const char *trainee) {
    struct store *store = api_store();
    store_add_trainee(store, trainee, NULL, NULL);
    assert_int_equal(store_enrol(store, trainee, "autumn", &err), RESULT_OK);
    store_close(&store);
}

static void a_trainee_sees_no_distribution_of_few_trainees(void **state) {
    (void)state;
    static const char path[] = "/distributions?case=many&course=autumn";
    static const char *const others[] = {"eve", "joan", "kate", "mary"};
    int sessions = 0;
    for (; sessions < 8; sessions++)
        put_session_of("ada", sessions);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(ask("GET", path, token_of("ada.l"), NULL), 200);
        assert_int_equal(count_at("distributions"), 0);
        assert_int_equal(ask("GET", path, token_of("grace"), NULL), 200);
        assert_near(number_at("distributions.0.n"), sessions, 0);
        enrol(others[i]);
        put_session_of(others[i], sessions++);
        put_session_of(others[i], sessions++);
        put_session_of("", 100 + i); // is of none of the course
    }
    assert_int_equal(ask("GET", path, token_of("ada.l"), NULL), 200);
    assert_int_equal(count_at("distributions"), 1);
    assert_near(number_at("distributions.0.n"), sessions, 0);
    for (int i = 0; i < sessions; i++) {
        char at[48];
        snprintf(at, sizeof at, "distributions.0.values.%d", i);
        assert_near(number_at(at), 8, 0); // the mean of all, 7.5, to steps of 2
    }
    assert_int_equal(ask("GET", path, token_of("grace"), NULL), 200);
    assert_near(number_at("distributions.0.values.3"), 3, 0);
}

// Those of a session that is somebody's, once in an hour.
static int readings(const char *session) {
    int count = 0;
    size_t i;
    json_t *row;
    char subject[64];
    snprintf(subject, sizeof subject, "session %s", session);
    assert_int_equal(ask("GET", "/audit", token_of("tom"), NULL), 200);
    json_array_foreach(json_object_get(said, "audit"), i, row) count +=
        !strcmp(json_string_value(json_object_get(row, "action")), "read") &&
        !strcmp(json_string_value(json_object_get(row, "subject")), subject);
    return count;
}

static void who_reads_a_trainees_session_is_in_the_audit_log(void **state) {
    (void)state;
    static const char *const parts[] = {"", "/trace", "/report"};
    char path[80];
    char grace[80], ada[80];
    snprintf(grace, sizeof grace, "%s", token_of("grace"));
    snprintf(ada, sizeof ada, "%s", token_of("ada.l"));
    assert_int_equal(ask("GET", "/sessions", grace, NULL), 200);
    assert_int_equal(readings(SESSION_ADA), 0);
    for (int i = 0; i < 9; i++) {
        snprintf(path, sizeof path, "/sessions/" SESSION_ADA "%s", parts[i % 3]);
        assert_int_equal(ask("GET", path, grace, NULL), 200);
        assert_int_equal(readings(SESSION_ADA), 1);
        assert_int_equal(ask("GET", path, ada, NULL), 200);
        assert_int_equal(readings(SESSION_ADA), 1);
    }
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "/sessions/" SESSION_EVE "%s", parts[i]);
        assert_int_equal(ask("GET", path, ada, NULL), 404);
    }
    assert_int_equal(readings(SESSION_EVE), 0);
    assert_int_equal(ask("GET", "/sessions/" SESSION_EVE "/trace", grace, NULL), 200);
    assert_int_equal(readings(SESSION_EVE), 1);
    assert_int_equal(ask("GET", "/sessions/" SESSION_NOBODY, grace, NULL), 200);
    assert_int_equal(readings(SESSION_NOBODY), 0);
}

// ---- people -------------------------------------------------------------------------------------

static void people_are_added_and_listed(void **state) {
    (void)state;
    const char *token = token_of("grace");
    assert_int_equal(
        ask("POST", "/trainees", token, "{\"name\":\"joan\",\"full_name\":\"Joan Clärke\"}"), 201);
    assert_string_equal(text_at("trainee.full_name"), "Joan Clärke");
    assert_int_equal(ask("POST", "/courses", token, "{\"name\":\"spring\"}"), 201);
    assert_int_equal(ask("POST", "/courses/spring/trainees", token, "{\"trainee\":\"joan\"}"), 204);
    assert_int_equal(ask("GET", "/courses/spring", token, NULL), 200);
    assert_string_equal(text_at("course.trainees.0.full_name"), "Joan Clärke");
    assert_int_equal(ask("GET", "/courses", token, NULL), 200);
    assert_near(number_at("courses.2.trainees"), 1, 0);
    assert_int_equal(ask("GET", "/trainees", token, NULL), 200);
    assert_string_equal(text_at("trainees.2.name"), "joan");
    assert_near(number_at("trainees.0.sessions"), 1, 0);
    assert_int_equal(
        ask("POST", "/accounts", token,
            "{\"name\":\"joan\",\"role\":\"trainee\",\"trainee\":\"joan\",\"password\":"
            "\"0123456789\"}"),
        201);
    assert_int_equal(ask("PATCH", "/accounts/tom", token, "{\"role\":\"instructor\"}"), 204);
    assert_int_equal(ask("GET", "/accounts", token, NULL), 200);
    assert_string_equal(text_at("accounts.1.role"), "instructor");
    assert_string_equal(text_at("accounts.3.trainee"), "joan");
    assert_null(strstr(answer.body, "argon2"));
    assert_int_equal(ask("DELETE", "/accounts/joan", token, NULL), 204);
    assert_int_equal(ask("GET", "/trainees", token, NULL), 200);
    assert_int_equal(count_at("trainees"), 3);
}

static void every_change_is_in_the_audit_log_with_who_made_it(void **state) {
    (void)state;
    static const struct {
        const char *method, *path, *body, *action;
    } changes[] = {
        {"POST", "/trainees", "{\"name\":\"x\"}", "add"},
        {"POST", "/courses", "{\"name\":\"x\"}", "add"},
        {"POST", "/courses/x/trainees", "{\"trainee\":\"x\"}", "enrol"},
        {"POST", "/trainees/x/code", "{}", "code"},
        {"POST", "/accounts",
         "{\"name\":\"x\",\"role\":\"technician\",\"password\":\"0123456789\"}", "add"},
        {"PATCH", "/accounts/x", "{\"role\":\"instructor\"}", "instructor"},
        {"PATCH", "/accounts/x", "{\"password\":\"9876543210\"}", "password"},
        {"DELETE", "/accounts/x", NULL, "remove"},
        {"POST", "/tokens", "{\"name\":\"x\"}", "add"},
        {"POST", "/stations/room-1/code", "{}", "code"},
    };
    const char *token = token_of("grace");
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        int status = ask(changes[i].method, changes[i].path, token, changes[i].body);
        assert_true(status >= 200 && status < 300);
        assert_int_equal(ask("GET", "/audit?limit=1", token, NULL), 200);
        assert_string_equal(text_at("audit.0.action"), changes[i].action);
        assert_string_equal(text_at("audit.0.actor"), "grace");
    }
    assert_int_equal(ask("POST", "/sign-out", token_of("ada.l"), NULL), 204);
    assert_int_equal(ask("GET", "/audit?limit=1", token, NULL), 200);
    assert_string_equal(text_at("audit.0.actor"), "trainee 1");
}

// ---- at once ------------------------------------------------------------------------------------

struct asker {
    pthread_t thread;
    int number, made, wrong;
    const char *token;
};

static int status_of(const struct asker *asker, const char *method, const char *path,
                     const char *body) {
    struct web_response response = {0};
    const struct web_request request = {.method = method,
                                        .path = path,
                                        .query = "",
                                        .body = body,
                                        .size = strlen(body),
                                        .token = asker->token,
                                        .address = "10.0.0.5"};
    api_answer(the_api, &request, &response);
    free(response.body);
    return response.status;
}

static void *ask_much(void *user) {
    static const char *const paths[] = {"/api/v1/cases",
                                        "/api/v1/sessions",
                                        "/api/v1/stations",
                                        "/api/v1/sessions/" SESSION_ADA "/report",
                                        "/api/v1/cases/healthy/anatomy.glb",
                                        "/api/v1/me"};
    struct asker *asker = user;
    for (int i = 0; i < 24; i++) {
        char body[64];
        int status = status_of(asker, "GET", paths[(i + asker->number) % 6], "");
        asker->wrong += status != 200 && status != 503;
        snprintf(body, sizeof body, "{\"name\":\"%d of %d\"}", i, asker->number);
        if (i % 8)
            continue;
        status = status_of(asker, "POST", "/api/v1/courses", body);
        asker->made += status == 201;
        asker->wrong += status != 201 && status != 503;
    }
    return NULL;
}

static void many_may_ask_at_once(void **state) {
    (void)state;
    struct asker askers[4];
    int made = 0;
    for (int i = 0; i < 4; i++) {
        askers[i] = (struct asker){.number = i, .token = token_of("grace")};
        assert_int_equal(pthread_create(&askers[i].thread, NULL, ask_much, &askers[i]), 0);
    }
    for (int i = 0; i < 4; i++) {
        pthread_join(askers[i].thread, NULL);
        assert_int_equal(askers[i].wrong, 0);
        made += askers[i].made;
    }
    assert_int_equal(ask("GET", "/courses", askers[0].token, NULL), 200);
    assert_true(made > 0);
    assert_int_equal(count_at("courses"), 2 + made);
}

// ---- the records
// ---------------------------------------------------------------------------------

static void a_database_that_is_none_is_told_to_nobody(void **state) {
    (void)state;
    const char *token = token_of("grace");
    write_file(api_dir, "records.db", "this is no database at all, is it?", 34);
    unlink(in_api("records.db-wal"));
    assert_int_equal(ask("GET", "/accounts", token, NULL), 500);
    assert_string_equal(error_code(), "failed");
    assert_null(strstr(answer.body, api_dir));
    struct web_account account;
    enum result result = api_enter(the_api, token, &account);
    assert_true(result != RESULT_OK && result != RESULT_MISSING); // not: nobody's
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, api_begin, api_end)
        TEST(a_trainee_sees_no_session_but_their_own),
        TEST(a_list_of_a_trainee_has_their_own_sessions_whatever_is_asked_for),
        TEST(an_account_of_no_trainee_has_no_sessions),
        TEST(sessions_come_newest_first_and_page_by_page),
        TEST(a_session_comes_with_its_results),
        TEST(a_trace_is_a_file_and_a_report_a_page),
        TEST(a_course_is_exported_as_a_zip),
        TEST(a_report_is_beside_a_course_of_ones_own),
        TEST(distributions_have_values_and_no_names),
        TEST(a_trainee_sees_distributions_of_their_own_courses),
        TEST(a_trainee_sees_no_distribution_of_few_trainees),
        TEST(who_reads_a_trainees_session_is_in_the_audit_log),
        TEST(people_are_added_and_listed),
        TEST(every_change_is_in_the_audit_log_with_who_made_it),
        TEST(many_may_ask_at_once),
        TEST(a_database_that_is_none_is_told_to_nobody),
    };
    return cmocka_run_group_tests_name("api_records", tests, NULL, NULL);
}
