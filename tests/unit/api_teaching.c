// A course at /api/v1: from the first attempt to the gate that opens, pass marks and what is behind
// them, an exam that is withheld, rated blindly, released and signed, and what erasing takes away.
#include "api/call.h"
#include "base/check.h"
#include "case/case.h"
#include "net/authority.h"
#include "records/audit_seal.h"
#include "store/courses.h"
#include "store/exams.h"
#include "test.h"
#include "unit/api_files.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct error err;
static bool is_new;
static int minutes; // of the next attempt

struct made {
    const char *session, *task, *hand, *purpose, *verdict, *end;
    double time_s; // 0: 25; below 0: it never ran
    bool early;    // it began before all exams
};

// The next attempt of a session; its number.
static int attempt(struct made made) {
    struct attempt_row row = {.number = ++minutes,
                              .task_version = 1,
                              .title = "A task",
                              .last_step = 100,
                              .time_s = made.time_s == 0 ? 25 : fmax(made.time_s, 0),
                              .goals = 1,
                              .goals_met = 1,
                              .pass_time_s = 30};
    row.begun_utc_ns = made.purpose && !made.early ? 4000000000000000000 + minutes * 60000000000LL
                                                   : minutes * 60000000000LL;
    snprintf(row.session, sizeof row.session, "%s", made.session);
    snprintf(row.task, sizeof row.task, "%s", made.task);
    snprintf(row.file_hash, sizeof row.file_hash, "%064d", 1);
    snprintf(row.hand, sizeof row.hand, "%s", made.hand ? made.hand : "right");
    snprintf(row.purpose, sizeof row.purpose, "%s", made.purpose ? made.purpose : "practice");
    snprintf(row.verdict, sizeof row.verdict, "%s", made.verdict ? made.verdict : "passed");
    snprintf(row.end, sizeof row.end, "%s", made.end ? made.end : "done");
    struct store *store = api_store();
    assert_ok(store_attempt_add(store, &row, &is_new, &err));
    store_close(&store);
    return row.number;
}

static void passed_by(const char *session, const char *task, const char *hand) {
    attempt((struct made){session, task, hand});
}

static void passed(const char *task, const char *hand) {
    passed_by(SESSION_ADA, task, hand);
}

static void failed(const char *task, const char *hand) {
    attempt((struct made){SESSION_ADA, task, hand, .verdict = "not yet"});
}

static void must(int status, const char *method, const char *path, const char *token,
                 const char *body) {
    int got = ask(method, path, token, body);
    if (got != status)
        fail_msg("%s %s: %d %s", method, path, got, answer.body ? answer.body : "");
}

#define PLAN                                                                                       \
    "\"tasks\":[{\"task\":\"steady\"},{\"task\":\"probing\",\"passes\":1,\"hands\":\"one\","       \
    "\"week\":2,\"due_utc_s\":1000}]}"

static void publish(void) {
    must(200, "PUT", "/courses/autumn/curriculum", token_of("grace"),
         "{\"version\":0,\"state\":\"published\"," PLAN);
}

// ---- curricula ----------------------------------------------------------------------------------

static void a_draft_is_the_instructors_until_it_is_published_and_frozen(void **state) {
    (void)state;
    const char *grace = token_of("grace"), *ada = token_of("ada.l");
    must(200, "PUT", "/courses/autumn/curriculum", grace,
         "{\"version\":0,\"state\":\"draft\"," PLAN);
    assert_string_equal(text_at("draft.state"), "draft");
    assert_string_equal(text_at("draft.tasks.1.after.0"), "steady");
    assert_string_equal(text_at("draft.tasks.0.hands"), "each");
    assert_float_equal(number_at("draft.tasks.0.passes"), 2, 0);
    assert_float_equal(number_at("draft.tasks.1.due_utc_s"), 1000, 0);
    assert_string_equal(text_at("draft.tasks.0.title"), "Steady camera");
    must(200, "GET", "/courses/autumn/curriculum", ada, NULL);
    assert_true(json_is_null(json_object_get(said, "curriculum")));
    assert_true(json_is_null(json_object_get(said, "draft")));
    must(200, "PUT", "/courses/autumn/curriculum", grace,
         "{\"version\":1,\"state\":\"published\"," PLAN);
    assert_float_equal(number_at("curriculum.version"), 1, 0);
    must(200, "PUT", "/courses/autumn/curriculum", grace,
         "{\"version\":1,\"state\":\"draft\",\"tasks\":[{\"task\":\"probing\"}]}");
    assert_float_equal(number_at("draft.version"), 2, 0);
    assert_float_equal(number_at("curriculum.version"), 1, 0);
    must(409, "PUT", "/courses/autumn/curriculum", grace,
         "{\"version\":1,\"state\":\"draft\"," PLAN);
    must(200, "GET", "/courses/autumn/curriculum", ada, NULL);
    assert_string_equal(text_at("curriculum.tasks.0.task"), "steady");
    must(200, "PUT", "/courses/autumn/curriculum", grace, "{\"version\":2,\"state\":\"frozen\"}");
    assert_string_equal(text_at("curriculum.state"), "frozen");
    assert_true(json_is_null(json_object_get(said, "draft")));
    must(409, "PUT", "/courses/autumn/curriculum", grace,
         "{\"version\":1,\"state\":\"published\"," PLAN);
    must(404, "GET", "/courses/winter/curriculum", ada, NULL);
    must(204, "DELETE", "/courses/autumn", grace, NULL);
    struct store *store = api_store(); // nothing of it is left
    struct curriculum *none = alloc(1, sizeof *none);
    assert_int_equal(store_read_curriculum(store, "autumn", true, none, &err), RESULT_MISSING);
    free(none);
    store_close(&store);
}

// ---- gates --------------------------------------------------------------------------------------

static void today(const char *next, const char *hand, double done) {
    must(200, "GET", "/trainees/me/today", token_of("ada.l"), NULL);
    assert_string_equal(text_at("courses.0.next.task"), next);
    assert_string_equal(text_at("courses.0.next.hand"), hand);
    assert_float_equal(number_at("courses.0.next.passes_done"), done, 0);
}

static void the_next_task_opens_after_so_many_passes_in_a_row_with_each_hand(void **state) {
    (void)state;
    publish();
    today("steady", "right", 0);
    assert_string_equal(text_at("courses.0.steps.1.state"), "locked");
    failed("steady", "right");
    passed("steady", "right");
    today("steady", "right", 1);
    failed("steady", "right"); // no longer in a row
    today("steady", "right", 0);
    passed("steady", "right");
    passed("probing", "right");                    // of another task, which is locked
    attempt((struct made){SESSION_EVE, "steady"}); // of another trainee
    attempt((struct made){SESSION_ADA, "steady", .purpose = "exam"});
    today("steady", "right", 1);
    passed("steady", "right");
    today("steady", "left", 0);
    failed("steady", "right"); // what was passed stays passed
    passed("steady", "left");
    passed("steady", "left");
    today("probing", "either", 0); // what was passed ahead opens nothing
    passed("probing", "right");
    must(200, "GET", "/trainees/me/today", token_of("ada.l"), NULL);
    assert_true(
        json_is_null(json_object_get(json_array_get(json_object_get(said, "courses"), 0), "next")));
    assert_float_equal(number_at("courses.0.passed"), 2, 0);
}

static void what_others_ended_and_what_never_ran_counts_for_nothing(void **state) {
    (void)state;
    publish();
    passed("steady", "right");
    attempt((struct made){SESSION_ADA, "steady", .verdict = "not yet", .end = "stopped"});
    attempt(
        (struct made){SESSION_ADA, "steady", .verdict = "not yet", .end = "left", .time_s = -1});
    today("steady", "right", 1);
    must(200, "GET", "/curve?task=steady", token_of("ada.l"), NULL);
    assert_int_equal(count_at("attempts"), 1);
    assert_float_equal(number_at("cusum.scores.0"), log(0.9 / 0.8), 1e-12);
    must(200, "GET", "/attempts", token_of("ada.l"), NULL);
    assert_int_equal(count_at("attempts"), 3);
    attempt((struct made){SESSION_ADA, "steady", .verdict = "not yet", .end = "left"});
    today("steady", "right", 0);
    must(200, "GET", "/curve?task=steady", token_of("ada.l"), NULL);
    assert_float_equal(number_at("cusum.scores.1"), 0, 0);
}

static void the_progress_of_a_course_is_its_trainees_by_its_tasks(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    must(204, "POST", "/courses/autumn/trainees", grace, "{\"trainee\":\"eve\"}");
    publish();
    passed("steady", "right");
    attempt((struct made){SESSION_EVE, "probing", .time_s = 21}); // ahead
    for (int i = 0; i < 4; i++)
        passed_by(SESSION_EVE, "steady", i < 2 ? "right" : "left");
    attempt((struct made){SESSION_EVE, "probing", .time_s = 28});
    must(200, "GET", "/courses/autumn/progress", grace, NULL);
    assert_int_equal(count_at("trainees"), 2);
    assert_string_equal(text_at("trainees.0.name"), "ada");
    assert_string_equal(text_at("trainees.0.cells.0.state"), "trying");
    assert_float_equal(number_at("trainees.0.cells.0.right.in_row"), 1, 0);
    assert_string_equal(text_at("trainees.0.cells.1.state"), "empty");
    assert_string_equal(text_at("trainees.1.cells.1.state"), "passed");
    assert_float_equal(number_at("trainees.1.cells.1.best_s"), 21, 0);
    assert_float_equal(number_at("behind"), 1, 0); // ada's probing was due long ago
    must(200, "GET", "/courses/autumn/progress", token_of("ada.l"), NULL);
    assert_int_equal(count_at("trainees"), 1);
    assert_null(strstr(answer.body, "eve"));
}

static void only_the_cases_of_a_task_count(void **state) {
    (void)state;
    must(200, "PUT", "/courses/autumn/curriculum", token_of("grace"),
         "{\"version\":0,\"state\":\"published\",\"tasks\":[{\"task\":\"steady\",\"hands\":\"one\","
         "\"cases\":[\"torn\"]}]}");
    passed("steady", "right"); // on healthy
    today("steady", "either", 0);
}

// ---- attempts -----------------------------------------------------------------------------------

static void a_trainee_sees_the_own_attempts_alone(void **state) {
    (void)state;
    const char *ada = token_of("ada.l"), *grace = token_of("grace");
    passed("steady", "right");
    attempt((struct made){SESSION_EVE, "steady"});
    must(200, "GET", "/attempts", ada, NULL);
    assert_int_equal(count_at("attempts"), 1);
    assert_string_equal(text_at("attempts.0.verdict"), "passed");
    must(200, "GET", "/attempts?trainee=eve", ada, NULL);
    assert_int_equal(count_at("attempts"), 0);
    must(404, "GET", "/attempts/" SESSION_EVE "/2", ada, NULL);
    must(404, "GET", "/attempts/" SESSION_EVE "/2/ratings", ada, NULL);
    must(200, "GET", "/curve?task=steady&trainee=eve", ada, NULL);
    assert_int_equal(count_at("attempts"), 0);
    must(200, "GET", "/attempts?limit=1", grace, NULL);
    assert_string_equal(text_at("attempts.0.trainee"), "eve");
    assert_string_equal(text_at("next"), SESSION_EVE ".2");
    must(200, "GET", "/attempts?limit=1&before=" SESSION_EVE ".2", grace, NULL);
    assert_string_equal(text_at("attempts.0.trainee"), "ada");
    assert_true(json_is_null(json_object_get(said, "next")));
    must(200, "GET", "/attempts?from=61&to=121", grace, NULL);
    assert_int_equal(count_at("attempts"), 1);
}

static void a_curve_says_when_its_attempts_show_competence(void **state) {
    (void)state;
    for (int i = 0; i < 30; i++)
        passed("steady", "right");
    must(200, "GET", "/curve?task=steady&course=autumn", token_of("ada.l"), NULL);
    assert_int_equal(count_at("attempts"), 30);
    assert_float_equal(number_at("cusum.competent_at"), 14, 0); // ceil(1.6 / ln(0.9 / 0.8))
    assert_float_equal(number_at("cusum.scores.0"), log(0.9 / 0.8), 1e-12);
    assert_int_equal(count_at("course"), 0); // of fewer than five
    must(200, "GET", "/curve?task=steady&trainee=ada&course=autumn", token_of("grace"), NULL);
    assert_int_equal(count_at("course"), 30);
}

// Five trainees of autumn with a time each; the session of number i.
// Sessions from `from` on.
static void five_in(const char *course, int from, const double times[5]) {
    struct store *store = api_store();
    for (int i = 0; i < 5; i++) {
        struct store_session s = {
            .case_hash = 7, .start_utc_ns = 1, .part = 1, .state = STATE_CLOSED};
        snprintf(s.id, sizeof s.id, "%032x", from + i);
        snprintf(s.station, sizeof s.station, "room-1");
        snprintf(s.case_name, sizeof s.case_name, "healthy");
        snprintf(s.trainee, sizeof s.trainee, "t%d", from + i);
        snprintf(s.trace, sizeof s.trace, "/none/%d", from + i);
        assert_ok(store_put_session(store, &s, NULL, 0, &err));
        assert_ok(store_enrol(store, s.trainee, course, &err));
    }
    store_close(&store);
    for (int i = 0; i < 5; i++) {
        char id[STORE_ID_MAX];
        snprintf(id, sizeof id, "%032x", from + i);
        attempt((struct made){id, "steady", .time_s = times[i]});
    }
}

static void five_trainees(const double times[5]) {
    five_in("autumn", 0x100, times);
}

static void a_trainee_sees_of_others_grouped_means_of_five_or_more(void **state) {
    (void)state;
    five_trainees((double[]){10, 20, 30, 40, 50});
    must(200, "GET", "/curve?task=steady&course=autumn", token_of("ada.l"), NULL);
    assert_int_equal(count_at("course"), 1);
    for (int q = 0; q < 3; q++) {
        char path[32];
        snprintf(path, sizeof path, "course.0.quartiles.%d", q);
        assert_float_equal(number_at(path), 30, 0); // the mean of all: nobody's own time
    }
    must(200, "GET", "/curve?task=steady&course=autumn&trainee=ada", token_of("grace"), NULL);
    assert_float_equal(number_at("course.0.quartiles.0"), 20, 1e-9);
    must(404, "GET", "/curve?task=steady&course=winter", token_of("ada.l"), NULL);
}

// ---- pass marks ---------------------------------------------------------------------------------

static void a_pass_mark_has_a_source_and_versions(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    must(200, "GET", "/tasks/steady/mark", grace, NULL);
    assert_string_equal(text_at("mark.kind"), "task file");
    assert_float_equal(number_at("mark.version"), 0, 0);
    must(200, "PUT", "/tasks/steady/mark", grace,
         "{\"kind\":\"published\",\"source\":\"FAST, n = 7\",\"time_s\":95,\"errors\":0,"
         "\"version\":0}");
    assert_float_equal(number_at("mark.version"), 1, 0);
    must(409, "PUT", "/tasks/steady/mark", grace,
         "{\"kind\":\"by hand\",\"source\":\"us\",\"time_s\":20,\"errors\":0,\"version\":0}");
    must(200, "GET", "/tasks/steady/mark", grace, NULL);
    assert_int_equal(count_at("versions"), 2);
    assert_string_equal(text_at("versions.0.source"), "FAST, n = 7");
    assert_string_equal(text_at("versions.1.kind"), "task file");
    must(200, "GET", "/tasks", token_of("ada.l"), NULL);
    assert_float_equal(number_at("tasks.0.mark.time_s"), 95, 0);
    assert_string_equal(text_at("tasks.1.tools.0"), "scope");
    assert_string_equal(text_at("tasks.1.tools.1"), "probe");
    assert_string_equal(text_at("tasks.0.tools.1"), "(none)"); // nothing is touched
    assert_float_equal(number_at("tasks.1.limits.0.reach_mm"), 3, 0);
    assert_true(isnan(number_at("tasks.0.limits.0.reach_mm")));
    assert_true(isnan(number_at("tasks.1.limits.0.rim_mm")));
}

static void the_attempts_behind_a_mark_say_how_many_would_pass(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    five_trainees((double[]){10, 20, 30, 40, 50});
    attempt((struct made){SESSION_ADA, "steady", .verdict = "not yet", .end = "time out"});
    must(200, "GET", "/tasks/steady/trials?time_s=30", grace, NULL);
    assert_float_equal(number_at("attempts"), 6, 0);
    assert_float_equal(number_at("would_pass"), 3, 0);
    assert_true(json_is_null(
        json_object_get(json_array_get(json_object_get(said, "trials"), 0), "time_s")));
    double counted = 0;
    for (size_t i = 0; i < count_at("bins"); i++) {
        char path[32];
        snprintf(path, sizeof path, "bins.%zu.count", i);
        counted += number_at(path);
    }
    assert_float_equal(counted, 5, 0);
    assert_null(strstr(answer.body, "t256")); // no names
    must(200, "GET", "/tasks/steady/trials?time_s=30&course=winter", grace, NULL);
    assert_float_equal(number_at("attempts"), 0, 0);
}

static void two_groups_give_a_mark_between_their_means(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    static const char path[] = "/tasks/steady/contrast?upper=autumn&lower=winter";
    five_trainees((double[]){10, 12, 14, 16, 18});
    must(204, "POST", "/courses/winter/trainees", grace, "{\"trainee\":\"eve\"}");
    for (int i = 0; i < 5; i++)
        attempt((struct made){SESSION_EVE, "steady", .time_s = 30 + 2 * i});
    must(200, "GET", path, grace, NULL);
    assert_true(isnan(number_at("cut_s")));
    assert_float_equal(number_at("lower.n"), 1, 0); // five times, one person
    must(204, "POST", "/courses/autumn/trainees", grace, "{\"trainee\":\"eve\"}"); // both
    five_in("winter", 0x200, (double[]){30, 32, 34, 36, 38});
    for (int i = 0; i < 2; i++)
        attempt((struct made){"00000000000000000000000000000200", "steady", .time_s = 29 + 2 * i});
    must(200, "GET", path, grace, NULL);
    assert_float_equal(number_at("lower.n"), 5, 0);
    assert_float_equal(number_at("lower.mean_s"), 34, 1e-9);
    assert_float_equal(number_at("cut_s"), 24, 1e-6); // equal spreads: halfway
    assert_float_equal(number_at("upper.mean_s"), 14, 1e-9);
}

// ---- exams --------------------------------------------------------------------------------------

#define BEGIN "{\"who\":true,\"station_check\":true,\"case_hash\":true,\"drift_mm\":0.4}"

static void plan_exam(const char *more) {
    char body[400];
    snprintf(body, sizeof body,
             "{\"course\":\"autumn\",\"trainee\":\"ada\",\"title\":\"Final\",\"tasks\":[\"steady\","
             "\"probing\"],\"cases\":[\"healthy\"],\"seed\":11%s}",
             more);
    must(201, "POST", "/exams", token_of("grace"), body);
}

// The case has the hash of the sessions of the test.
static void begin_exam_of(int id) {
    struct store *store = api_store();
    struct exam_checklist checked = {.who = true, .station_check = true, .drift_mm = 0.4};
    snprintf(checked.case_hashes[0], 17, "%016d", 7);
    snprintf(checked.case_hashes[1], 17, "%016d", 7);
    assert_ok(store_begin_exam(store, id, &checked, &err));
    store_close(&store);
}

static void begin_exam(void) {
    begin_exam_of(1);
}

static void add_instructor(const char *name) {
    struct store *store = api_store();
    assert_ok(store_add_account(store, name, ROLE_INSTRUCTOR, NO_PASSWORD, NULL, &err));
    store_close(&store);
}

static void assert_signed(void) {
    struct store_audit_seal *seal = alloc(1, sizeof *seal);
    char authority[256], by[TRACE_SIGNED_BY_MAX];
    snprintf(authority, sizeof authority, "%s/keys/authority.pem", api_dir);
    seal->head.entry = 1;
    seal->utc_ns = (int64_t)(number_at("exam.released_utc_s") * 1e9);
    snprintf(seal->head.hash, sizeof seal->head.hash, "%s", text_at("exam.result.hash"));
    snprintf(seal->certificate, sizeof seal->certificate, "%s", text_at("exam.result.certificate"));
    snprintf(seal->signature, sizeof seal->signature, "%s", text_at("exam.result.signature"));
    assert_ok(exam_seal_check(seal, authority, by, &err));
    seal->head.hash[0] = seal->head.hash[0] == '0' ? '1' : '0'; // another result
    assert_int_equal(exam_seal_check(seal, authority, by, &err), RESULT_REFUSED);
    free(seal);
}

static void an_exam_is_withheld_until_it_is_released_and_signed(void **state) {
    (void)state;
    const char *ada = token_of("ada.l"), *grace = token_of("grace");
    plan_exam("");
    assert_string_equal(text_at("exam.state"), "planned");
    must(200, "GET", "/exams/1", ada, NULL);
    assert_string_equal(text_at("exam.items.0.task"), "(none)"); // sealed
    must(400, "POST", "/exams", grace,
         "{\"course\":\"autumn\",\"trainee\":\"ada\",\"title\":\"A\",\"tasks\":[\"steady\"],"
         "\"cases\":[\"healthy\"],\"raters\":[\"grace\"]}");
    must(409, "POST", "/exams/1/release", grace, "{}");
    must(409, "POST", "/exams/1/interventions", grace, "{\"reason\":\"too early\"}");
    attempt((struct made){SESSION_ADA, "steady", .purpose = "exam"}); // before it began
    begin_exam();
    attempt((struct made){SESSION_ADA, "steady", .purpose = "exam", .early = true});
    int first = attempt((struct made){SESSION_ADA, "steady", .purpose = "exam"});
    attempt((struct made){SESSION_ADA, "steady", .purpose = "exam", .verdict = "not yet"});
    must(200, "POST", "/exams/1/interventions", grace, "{\"reason\":\"The hose came off.\"}");
    must(409, "POST", "/exams/1/release", grace, "{}");
    attempt((struct made){SESSION_ADA, "probing", .purpose = "exam"});
    must(200, "GET", "/exams/1", grace, NULL);
    assert_string_equal(text_at("exam.state"), "done");
    assert_float_equal(number_at("exam.items.0.number"), first, 0); // and not a later one
    assert_string_equal(text_at("exam.items.0.verdict"), "passed");
    must(200, "GET", "/exams/1", ada, NULL);
    assert_string_equal(text_at("exam.items.0.verdict"), "(none)");
    assert_null(strstr(answer.body, "seed"));
    must(200, "GET", "/attempts", ada, NULL);
    assert_string_equal(text_at("attempts.0.verdict"), "(none)");
    assert_true(isnan(number_at("attempts.0.time_s")));
    must(403, "GET", "/sessions/" SESSION_ADA "/trace", ada, NULL); // it has the outcome too
    must(403, "GET", "/sessions/" SESSION_ADA "/report", ada, NULL);
    must(200, "GET", "/sessions/" SESSION_ADA, ada, NULL);
    assert_int_equal(count_at("results"), 0);
    must(200, "GET", "/sessions/" SESSION_ADA "/trace", grace, NULL);
    assert_int_equal(api_released, 0);
    must(200, "POST", "/exams/1/release", grace, "{}");
    assert_int_equal(api_released, 2);
    assert_signed();
    must(200, "GET", "/exams/1", ada, NULL);
    assert_string_equal(text_at("exam.verdict"), "passed");
    assert_non_null(strstr(text_at("exam.result.text"), "The hose came off."));
    assert_null(strstr(answer.body, "seed"));
    assert_true(json_is_true(json_object_get(json_object_get(said, "exam"), "flagged")));
    must(200, "GET", "/attempts", ada, NULL);
    assert_string_equal(text_at("attempts.0.verdict"), "passed");
    must(403, "GET", "/sessions/" SESSION_ADA "/trace", ada, NULL); // it has one of no exam too
    must(409, "POST", "/exams/1/release", grace, "{}");
    must(409, "DELETE", "/exams/1", grace, NULL);
}

static void an_exam_that_was_not_done_is_released_only_as_such(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    plan_exam("");
    begin_exam();
    must(200, "POST", "/exams/1/release", grace, "{\"incomplete\":true}");
    assert_string_equal(text_at("exam.verdict"), "not yet");
}

static void the_seed_draws_the_cases(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    int torn = 0;
    for (int seed = 0; seed < 32; seed++) {
        char body[256], drawn[64];
        snprintf(
            body, sizeof body,
            "{\"course\":\"autumn\",\"trainee\":\"ada\",\"title\":\"A\",\"tasks\":[\"steady\"],"
            "\"cases\":[\"healthy\",\"torn\"],\"seed\":%d}",
            seed);
        must(201, "POST", "/exams", grace, body);
        snprintf(drawn, sizeof drawn, "%s", text_at("exam.items.0.case"));
        must(201, "POST", "/exams", grace, body);
        assert_string_equal(text_at("exam.items.0.case"), drawn);
        torn += !strcmp(drawn, "torn");
    }
    assert_in_range(torn, 8, 24);
    must(201, "POST", "/exams", grace,
         "{\"course\":\"autumn\",\"trainee\":\"ada\",\"title\":\"A\",\"tasks\":[\"steady\"],"
         "\"cases\":[\"healthy\"]}");
    assert_true(number_at("exam.seed") > 0);
}

// ---- ratings ------------------------------------------------------------------------------------

static void rate(const char *token, int number, int level, int status) {
    char path[96], body[256];
    snprintf(path, sizeof path, "/attempts/" SESSION_ADA "/%d/ratings", number);
    snprintf(body, sizeof body,
             "{\"safety\":%d,\"field_of_view\":3,\"camera_dexterity\":3,\"instrument_dexterity\":3,"
             "\"bimanual_dexterity\":3,\"flow\":3,\"quality\":5,\"autonomy\":3}",
             level);
    must(status, "POST", path, token, body);
}

static void raters_know_neither_the_trainee_nor_each_other(void **state) {
    (void)state;
    add_instructor("rita");
    add_instructor("rob");
    static const char *const paths[] = {"/exams/1",
                                        "/exams",
                                        "/attempts",
                                        "/rate",
                                        "/stations",
                                        "/sessions",
                                        "/sessions/" SESSION_ADA};
    plan_exam(",\"raters\":[\"rita\",\"rob\"]");
    begin_exam();
    passed("probing", "right"); // of the same session
    int number = attempt((struct made){SESSION_ADA, "steady", .purpose = "exam"});
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        must(200, "GET", paths[i], token_of("rita"), NULL);
        if (strstr(answer.body, "\"ada"))
            fail_msg("%s: %s", paths[i], answer.body);
    }
    static const char *const oracles[] = {"/attempts?trainee=ada", "/sessions?trainee=ada",
                                          "/exams?trainee=ada", "/curve?task=probing&trainee=ada"};
    for (size_t i = 0; i < sizeof oracles / sizeof *oracles; i++) {
        must(200, "GET", oracles[i], token_of("rita"), NULL);
        if (strstr(answer.body, SESSION_ADA) || strstr(answer.body, "\"Final"))
            fail_msg("%s: %s", oracles[i], answer.body);
        must(200, "GET", oracles[i], token_of("grace"), NULL);
        assert_true(strstr(answer.body, SESSION_ADA) || strstr(answer.body, "\"Final"));
    }
    must(200, "GET", "/stations", token_of("grace"), NULL);
    assert_string_equal(text_at("stations.0.trainee"), "ada");
    must(200, "GET", "/exams/1", token_of("rita"), NULL);
    assert_string_equal(text_at("exam.items.0.verdict"), "(none)");
    must(200, "GET", "/attempts?purpose=exam", token_of("rita"), NULL);
    assert_string_equal(text_at("attempts.0.verdict"), "(none)");
    rate(token_of("grace"), number, 3, 409); // no rater of it
    must(403, "GET", "/sessions/" SESSION_ADA "/trace", token_of("rita"), NULL);
    must(403, "GET", "/sessions/" SESSION_ADA "/report", token_of("rita"), NULL);
    must(200, "GET", "/sessions/" SESSION_ADA, token_of("grace"), NULL);
    assert_string_equal(text_at("session.trainee"), "ada");
    must(200, "GET", "/rate", token_of("rita"), NULL);
    assert_int_equal(count_at("attempts"), 1);
    char path[96];
    snprintf(path, sizeof path, "/attempts/" SESSION_ADA "/%d/ratings", number);
    rate(token_of("rob"), number, 2, 201);
    must(200, "GET", path, token_of("rita"), NULL);
    assert_int_equal(count_at("ratings"), 0);
    assert_float_equal(number_at("others"), 1, 0);
    assert_true(json_is_null(json_object_get(said, "agreement")));
    rate(token_of("rita"), number, 4, 201);
    assert_float_equal(number_at("rating.sum"), 27, 0);
    must(200, "GET", path, token_of("rita"), NULL);
    assert_int_equal(count_at("ratings"), 2);
    assert_float_equal(number_at("agreement.difference"), 2, 0);
    must(200, "GET", path, token_of("ada.l"), NULL);
    assert_int_equal(count_at("ratings"), 0);
    must(200, "POST", "/exams/1/release", token_of("grace"), "{\"incomplete\":true}");
    must(200, "GET", path, token_of("ada.l"), NULL);
    assert_int_equal(count_at("ratings"), 2);
    assert_null(strstr(answer.body, "rita"));
    must(200, "GET", "/exams/1", token_of("ada.l"), NULL);
    assert_null(strstr(answer.body, "rita"));
    assert_non_null(strstr(text_at("exam.result.text"), "\"rater\":2"));
    rate(token_of("rita"), number, 5, 409);
    must(200, "GET", "/courses/autumn/agreement", token_of("grace"), NULL);
    assert_float_equal(number_at("pairs"), 1, 0);
}

static void the_agreement_of_a_course_is_that_of_its_pairs(void **state) {
    (void)state;
    add_instructor("rita");
    add_instructor("rob");
    for (int i = 0; i < 4; i++) {
        plan_exam(",\"raters\":[\"rita\",\"rob\"]");
        begin_exam_of(i + 1);
        int number = attempt((struct made){SESSION_ADA, "steady", .purpose = "exam"});
        rate(token_of("rita"), number, i + 1, 201);
        rate(token_of("rob"), number, i + 1, 201);
        attempt((struct made){SESSION_ADA, "probing", .purpose = "exam"});
    }
    int practice = attempt((struct made){SESSION_ADA, "steady"}); // nobody rates it blindly
    rate(token_of("rita"), practice, 1, 201);
    rate(token_of("grace"), practice, 5, 201);
    passed("steady", "right"); // nobody rates it
    must(200, "GET", "/courses/autumn/agreement", token_of("grace"), NULL);
    assert_float_equal(number_at("pairs"), 4, 0);
    assert_float_equal(number_at("icc"), 1, 1e-12);
    assert_float_equal(number_at("kappa"), 1, 1e-12);
}

// ---- erasing ------------------------------------------------------------------------------------

static void erasing_a_trainee_erases_attempts_ratings_and_exams(void **state) {
    (void)state;
    const char *grace = token_of("grace");
    add_instructor("rita");
    plan_exam(",\"raters\":[\"rita\"]");
    begin_exam();
    int number = attempt((struct made){SESSION_ADA, "steady", .purpose = "exam"});
    must(200, "POST", "/exams/1/interventions", grace, "{\"reason\":\"Ada fainted.\"}");
    rate(token_of("rita"), number, 4, 201);
    attempt((struct made){SESSION_EVE, "steady"});
    must(200, "POST", "/trainees/ada/erase", grace, "{}");
    struct store *store = api_store();
    static const enum store_list gone[] = {LIST_EXAMS, LIST_EXAM_TASKS, LIST_EXAM_RATERS,
                                           LIST_INTERVENTIONS, LIST_RATINGS};
    json_t *rows = json_array();
    for (size_t i = 0; i < sizeof gone / sizeof *gone; i++)
        assert_ok(store_rows(store, gone[i], NULL, call_take_row, rows, &err));
    assert_int_equal(json_array_size(rows), 0);
    assert_ok(store_rows(store, LIST_ATTEMPTS, NULL, call_take_row, rows, &err));
    assert_int_equal(json_array_size(rows), 1); // eve's
    json_decref(rows);
    store_close(&store);
}

static int begin(void **state) {
    minutes = 0;
    return api_begin(state);
}

// ---- an expert's hands --------------------------------------------------------------------------

static void an_experts_hands_are_computed_once_and_never_during_an_exam(void **state) {
    (void)state;
    const char *ada = token_of("ada.l"), *grace = token_of("grace");
    api_rehearsed = 0;
    api_wait_for_cases(ada);
    for (int i = 0; i < 2; i++) {
        must(200, "GET", "/tasks/steady/expert?case=healthy", ada, NULL);
        assert_int_equal(answer.size, 5);
        assert_memory_equal(answer.body, "hands", 5);
    }
    assert_int_equal(api_rehearsed, 1);
    must(404, "GET", "/tasks/probing/expert?case=healthy", ada, NULL); // that cannot be done
    must(404, "GET", "/tasks/probing/expert?case=healthy", ada, NULL);
    assert_int_equal(api_rehearsed, 2);
    must(404, "GET", "/tasks/steady/expert?case=torn", ada, NULL); // that cannot be read
    assert_int_equal(api_rehearsed, 2);
    must(404, "GET", "/tasks/steady/expert", ada, NULL);
    must(404, "GET", "/tasks/none/expert?case=healthy", ada, NULL);
    plan_exam("");
    must(200, "GET", "/tasks/steady/expert?case=healthy", ada, NULL);
    begin_exam();
    must(409, "GET", "/tasks/steady/expert?case=healthy", ada, NULL);
    must(200, "GET", "/tasks/steady/expert?case=healthy", grace, NULL);
    assert_int_equal(api_rehearsed, 2);
}

static int status_meanwhile;

// Another one asks while these are computed.
static void ask_meanwhile(void) {
    api_on_rehearse = NULL;
    status_meanwhile = ask("GET", "/tasks/probing/expert?case=healthy", token_of("grace"), NULL);
    assert_true(answer.retry_after_s > 0);
}

static void one_expert_is_computed_at_a_time(void **state) {
    (void)state;
    api_on_rehearse = ask_meanwhile;
    api_wait_for_cases(token_of("ada.l"));
    must(200, "GET", "/tasks/steady/expert?case=healthy", token_of("ada.l"), NULL);
    assert_int_equal(status_meanwhile, 503);
}

static void hands_on_a_case_that_changed_are_computed_anew(void **state) {
    (void)state;
    const char *ada = token_of("ada.l");
    struct knee_case *knee;
    api_on_rehearse = NULL;
    api_rehearsed = 0;
    api_wait_for_cases(ada);
    must(200, "GET", "/tasks/steady/expert?case=healthy", ada, NULL);
    assert_ok(case_load(in_api("healthy"), NULL, &knee, &err));
    snprintf(knee->title, sizeof knee->title, "Another knee than before");
    assert_ok(case_save(knee, in_api("healthy"), &err));
    case_destroy(&knee);
    int status = 503; // while it reads the case
    while (status == 503)
        status = ask("GET", "/tasks/steady/expert?case=healthy", ada, NULL);
    assert_int_equal(status, 200);
    assert_int_equal(api_rehearsed, 2);
}

// Each that is not kept: it fails in a way that may pass.
static void one_person_makes_the_server_compute_only_so_often(void **state) {
    (void)state;
    const char *ada = token_of("ada.l"), *grace = token_of("grace");
    api_on_rehearse = NULL;
    api_rehearsed = 0;
    api_wait_for_cases(ada);
    api_rehearse_fails = true;
    int status = 404;
    for (int i = 0; i < 20 && status == 404; i++)
        status = ask("GET", "/tasks/steady/expert?case=healthy", ada, NULL);
    api_rehearse_fails = false;
    assert_int_equal(status, 429);
    assert_int_equal(answer.retry_after_s, 10);
    assert_int_equal(api_rehearsed, 8);
    must(200, "GET", "/tasks/steady/expert?case=healthy", grace, NULL);
    must(200, "GET", "/tasks/steady/expert?case=healthy", ada, NULL); // it is kept
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, begin, api_end)
        TEST(a_draft_is_the_instructors_until_it_is_published_and_frozen),
        TEST(the_next_task_opens_after_so_many_passes_in_a_row_with_each_hand),
        TEST(what_others_ended_and_what_never_ran_counts_for_nothing),
        TEST(the_progress_of_a_course_is_its_trainees_by_its_tasks),
        TEST(only_the_cases_of_a_task_count),
        TEST(a_trainee_sees_the_own_attempts_alone),
        TEST(a_curve_says_when_its_attempts_show_competence),
        TEST(a_trainee_sees_of_others_grouped_means_of_five_or_more),
        TEST(a_pass_mark_has_a_source_and_versions),
        TEST(the_attempts_behind_a_mark_say_how_many_would_pass),
        TEST(two_groups_give_a_mark_between_their_means),
        TEST(an_exam_is_withheld_until_it_is_released_and_signed),
        TEST(an_exam_that_was_not_done_is_released_only_as_such),
        TEST(the_seed_draws_the_cases),
        TEST(raters_know_neither_the_trainee_nor_each_other),
        TEST(the_agreement_of_a_course_is_that_of_its_pairs),
        TEST(erasing_a_trainee_erases_attempts_ratings_and_exams),
        TEST(an_experts_hands_are_computed_once_and_never_during_an_exam),
        TEST(one_expert_is_computed_at_a_time),
        TEST(hands_on_a_case_that_changed_are_computed_anew),
        TEST(one_person_makes_the_server_compute_only_so_often),
    };
    return cmocka_run_group_tests_name("api_teaching", tests, NULL, NULL);
}
