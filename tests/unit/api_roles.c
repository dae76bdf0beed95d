// Who may do what with /api/v1: every route for everybody, beside the description that the server
// gives (tests/siege/crawl.py has a table of its own), and what is malformed, as rows of data.
#include "api/routes.h"
#include "test.h"
#include "unit/api_files.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- roles --------------------------------------------------------------------------------------

// i instructor, t technician, o trainee with an account, c trainee by a code, - nobody.
static const char everybody[] = "itoc-";

// The paths of the description that the server gives; the caller releases them.
static json_t *described_paths(void) {
    assert_int_equal(ask("GET", "/openapi.json", NULL, NULL), 200);
    return json_incref(json_object_get(said, "paths"));
}

static bool is_role_of(const char *role, char who) {
    if (!strcmp(role, "trainee"))
        return who == 'o' || who == 'c';
    return !strcmp(role, "anyone") || !strcmp(role, "always") ||
           (!strcmp(role, "instructor") && who == 'i') ||
           (!strcmp(role, "technician") && who == 't');
}

static bool may_ask(const json_t *operation, char who) {
    size_t i;
    json_t *role;
    const char *answer_of = json_string_value(json_object_get(operation, "operationId"));
    if (who == 'c' && !strcmp(answer_of, "post_tokens")) // a token would outlive the code
        return false;
    json_array_foreach(json_object_get(operation, "x-role"), i, role) {
        if (is_role_of(json_string_value(role), who))
            return true;
    }
    return false;
}

// A name for a path: something that is there, to be looked at; else nothing changes.
static const char *name_for(const char *path, bool looks) {
    static const struct {
        const char *begin, *name;
    } there[] = {{"/courses/", "autumn"},     {"/cases/", "healthy"}, {"/peer/cases/", "case.json"},
                 {"/sessions/", SESSION_ADA}, {"/tasks/", "steady"},  {"/attempts/{", SESSION_ADA}};
    for (size_t i = 0; looks && i < sizeof there / sizeof *there; i++)
        if (!strncmp(path, there[i].begin, strlen(there[i].begin)))
            return there[i].name;
    return "none";
}

static void fill(const char *path, bool looks, char out[128]) {
    const char *name = name_for(path, looks);
    size_t used = 0;
    while (*path) {
        if (*path != '{') {
            out[used++] = *path++;
            continue;
        }
        used += (size_t)sprintf(out + used, "%s", strncmp(path, "{number", 7) ? name : "1");
        path += strcspn(path, "}") + 1;
    }
    out[used] = '\0';
}

static void upper_case(const char *method, char out[8]) {
    size_t i = 0;
    for (; method[i]; i++)
        out[i] = (char)toupper((unsigned char)method[i]);
    out[i] = '\0';
}

static const char *token_for(char who) {
    switch (who) {
    case 'i':
        return token_of("grace");
    case 't':
        return token_of("tom");
    case 'o':
        return token_of("ada.l");
    case 'c':
        return token_of_code("ada");
    default:
        return NULL;
    }
}

static void ask_as_everybody(const char *method, const char *path, const json_t *operation) {
    for (const char *who = everybody; *who; who++) {
        const char *body = strcmp(method, "GET") ? "{}" : NULL;
        int status = ask(method, path, token_for(*who), body);
        bool denied = status == 403 || (status == 401 && !strcmp(error_code(), "not_signed_in"));
        if (denied == may_ask(operation, *who))
            fail_msg("%s %s by %c: %d", method, path, *who, status);
        if (denied)
            assert_int_equal(status, *who == '-' ? 401 : 403);
    }
}

static void everybody_may_what_the_description_says_and_no_more(void **state) {
    (void)state;
    const char *path, *name;
    json_t *paths = described_paths(), *methods, *operation;
    json_object_foreach(paths, path, methods) {
        json_object_foreach(methods, name, operation) {
            char method[8], filled[128];
            upper_case(name, method);
            fill(path, !strcmp(method, "GET"), filled);
            ask_as_everybody(method, filled, operation);
        }
    }
    json_decref(paths);
}

// The description says who may ask for accounts at all; a technician's are those of technicians.
static void a_technician_manages_technicians_and_nobody_above(void **state) {
    (void)state;
    static const struct {
        const char *method, *path, *body;
        int status;
    } rows[] = {
        {"POST", "/accounts",
         "{\"name\":\"x\",\"role\":\"instructor\",\"password\":\"0123456789\"}", 403},
        {"POST", "/accounts",
         "{\"name\":\"x\",\"role\":\"trainee\",\"password\":\"0123456789\",\"trainee\":\"ada\"}",
         403},
        {"PATCH", "/accounts/tom", "{\"role\":\"instructor\"}", 403},
        {"PATCH", "/accounts/grace", "{\"password\":\"0123456789\"}", 403},
        {"PATCH", "/accounts/grace", "{\"role\":\"technician\"}", 403},
        {"PATCH", "/accounts/ada.l", "{\"password\":\"0123456789\"}", 403},
        {"DELETE", "/accounts/grace", NULL, 403},
        {"POST", "/accounts/grace/sign-out", "{}", 403},
        {"POST", "/accounts/ada.l/sign-out", "{}", 403},
        {"PATCH", "/accounts/grace", "{\"name\":\"x\"}", 403},
        {"DELETE", "/accounts/ada.l", NULL, 403},
        {"POST", "/accounts",
         "{\"name\":\"x\",\"role\":\"technician\",\"password\":\"0123456789\"}", 201},
        {"PATCH", "/accounts/x", "{\"role\":\"instructor\"}", 403},
        {"PATCH", "/accounts/x", "{\"role\":\"instructor\",\"password\":\"0123456789\"}", 403},
        {"PATCH", "/accounts/x", "{\"password\":\"9876543210\"}", 204},
        {"DELETE", "/accounts/x", NULL, 204},
    };
    const char *token = token_of("tom");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (ask(rows[i].method, rows[i].path, token, rows[i].body) != rows[i].status)
            fail_msg("%s %s %s: %d", rows[i].method, rows[i].path, rows[i].body ? rows[i].body : "",
                     answer.status);
    token = token_of("grace"); // and all is as it was
    assert_int_equal(ask("GET", "/accounts", token, NULL), 200);
    assert_int_equal(json_array_size(json_object_get(said, "accounts")), 3);
    assert_string_equal(text_at("accounts.0.role"), "instructor");
    assert_string_equal(text_at("accounts.1.role"), "technician");
}

static void the_routes_are_those_of_the_description(void **state) {
    (void)state;
    int count = 0;
    const char *path, *name;
    json_t *paths = described_paths(), *methods, *operation;
    json_object_foreach(paths, path, methods) {
        json_object_foreach(methods, name, operation) {
            char method[8], filled[128], whole[160], args[2][STORE_NAME_MAX];
            bool there;
            upper_case(name, method);
            fill(path, false, filled);
            snprintf(whole, sizeof whole, API_PREFIX "%s", filled);
            assert_non_null(routes_find(method, whole, args, &there));
            count++;
        }
    }
    assert_int_equal(count, route_count);
    json_decref(paths);
}

// ---- paths --------------------------------------------------------------------------------------

static void a_path_that_is_none_is_not_found(void **state) {
    (void)state;
    static const char *const paths[] = {"",
                                        "/",
                                        "/nothing",
                                        "/sessions/",
                                        "/sessions//trace",
                                        "/sessions/a/b/c",
                                        "/me/",
                                        "/me/x",
                                        "//me",
                                        "/cases/../cases",
                                        "/cases/healthy/../healthy/case.json",
                                        "/cases/healthy/recorded.json",
                                        "/cases/none",
                                        "/cases/none/case.json",
                                        "/sessions/" SESSION_ADA "/../" SESSION_ADA,
                                        "/sessions/0123456789ABCDEF0123456789ABCDEF",
                                        "/courses/none",
                                        "/accounts",
                                        "/cases/"
                                        "0123456789012345678901234567890123456789012345678901234567"
                                        "890123456789"};
    const char *token = token_of("grace");
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        bool is_there = !strcmp(paths[i], "/accounts");
        assert_int_equal(ask("GET", paths[i], token, NULL), is_there ? 200 : 404);
    }
    assert_int_equal(ask("PUT", "/accounts", token, NULL), 405);
    assert_int_equal(ask("PATCH", "/sessions/" SESSION_ADA, token, "{}"), 405);
}

// ---- what is malformed --------------------------------------------------------------------------

#define MARK(kind, source, time_s, errors, version)                                                \
    "{\"kind\":\"" kind "\",\"source\":" source ",\"time_s\":" time_s ",\"errors\":" errors        \
    ",\"version\":" version "}"
#define PLAN(state, tasks) "{\"version\":0,\"state\":" state ",\"tasks\":[" tasks "]}"
#define RATING(safety, autonomy)                                                                   \
    "{\"safety\":" safety                                                                          \
    ",\"field_of_view\":3,\"camera_dexterity\":3,\"instrument_dexterity\":3,"                      \
    "\"bimanual_dexterity\":3,\"flow\":3,\"quality\":3,\"autonomy\":" autonomy "}"
#define EXAM(course, tasks, cases, more)                                                           \
    "{\"course\":\"" course "\",\"trainee\":\"ada\",\"title\":\"Final\",\"tasks\":[" tasks         \
    "],\"cases\":[" cases "]" more "}"

static const struct {
    const char *method, *path, *body;
    int status;
    const char *code, *field;
} wrong[] = {
    {"POST", "/tokens", "{", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "[]", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "null", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "\"name\"", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "{\"name\":\"a\"}x", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "{\"name\":\"a\",\"name\":\"b\"}", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "{\"name\":\"a\\u0000b\"}", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "{\"name\":\"\xff\"}", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "{\"name\":\"\\ud800\"}", 400, "wrong_body", "(none)"},
    {"POST", "/tokens", "[[[[[[[[[[]]]]]]]]]]", 413, "too_large", "(none)"},
    {"POST", "/tokens", "{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":1}}}}}", 413, "too_large", "(none)"},
    {"POST", "/tokens", "[[[[[", 413, "too_large", "(none)"},
    {"POST", "/tokens", "", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":null}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":7}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":[\"a\"]}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":\"\"}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":\" a\"}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":\"a/b\"}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":\"a\\nb\"}", 400, "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":\"a\\u0085b\"}", 400, "wrong_field", "(none)"},
    {"POST", "/tokens",
     "{\"name\":\"0123456789012345678901234567890123456789012345678901234567890123\"}", 400,
     "wrong_field", "name"},
    {"POST", "/tokens", "{\"name\":\"a\",\"until\":\"b\"}", 400, "wrong_field", "(none)"},
    {"POST", "/courses", "{\"name\":\"autumn\"}", 409, "conflict", "(none)"},
    {"POST", "/trainees", "{\"name\":\"ada\"}", 409, "conflict", "(none)"},
    {"POST", "/trainees", "{\"name\":\"x\",\"full_name\":\"a\\tb\"}", 400, "wrong_field", "(none)"},
    {"POST", "/trainees/none/code", "{}", 404, "not_found", "(none)"},
    {"POST", "/trainees/ada/code", "{\"life\":\"1\"}", 400, "wrong_field", "(none)"},
    {"POST", "/courses/autumn/trainees", "{\"trainee\":\"none\"}", 404, "not_found", "(none)"},
    {"POST", "/courses/none/trainees", "{\"trainee\":\"ada\"}", 404, "not_found", "(none)"},
    {"PATCH", "/trainees/ada", "{}", 400, "wrong_body", "(none)"},
    {"PATCH", "/trainees/ada", "{\"name\":\"eve\"}", 409, "conflict", "(none)"},
    {"PATCH", "/trainees/ada", "{\"name\":\"a/b\"}", 400, "wrong_field", "name"},
    {"PATCH", "/trainees/ada", "{\"full_name\":\"a\\tb\"}", 400, "wrong_field", "(none)"},
    {"PATCH", "/trainees/none", "{\"name\":\"x\"}", 404, "not_found", "(none)"},
    {"DELETE", "/trainees/ada", NULL, 409, "conflict", "(none)"},
    {"DELETE", "/trainees/none", NULL, 404, "not_found", "(none)"},
    {"POST", "/trainees/none/erase", "{}", 404, "not_found", "(none)"},
    {"POST", "/trainees/none/sign-out", "{}", 404, "not_found", "(none)"},
    {"PATCH", "/courses/autumn", "{}", 400, "wrong_field", "name"},
    {"PATCH", "/courses/autumn", "{\"name\":\"winter\"}", 409, "conflict", "(none)"},
    {"PATCH", "/courses/none", "{\"name\":\"x\"}", 404, "not_found", "(none)"},
    {"DELETE", "/courses/none", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/courses/none/trainees/ada", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/courses/autumn/trainees/eve", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/sessions/" SESSION_ADA "0", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/sessions/0123456789abcdef0123456789abcdef", NULL, 404, "not_found", "(none)"},
    {"PATCH", "/accounts/tom", "{\"name\":\"grace\"}", 409, "conflict", "(none)"},
    {"POST", "/accounts/none/sign-out", "{}", 404, "not_found", "(none)"},
    {"POST", "/accounts", "{\"name\":\"x\",\"role\":\"king\",\"password\":\"0123456789\"}", 400,
     "wrong_field", "role"},
    {"POST", "/accounts", "{\"name\":\"x\",\"role\":\"technician\",\"password\":\"012345678\"}",
     400, "wrong_field", "password"},
    {"POST", "/accounts", "{\"name\":\"x\",\"role\":\"technician\",\"password\":\"äöüäöüäöü\"}",
     400, "wrong_field", "password"},
    {"POST", "/accounts", "{\"name\":\"x\",\"role\":\"technician\"}", 400, "wrong_field",
     "password"},
    {"POST", "/accounts", "{\"name\":\"x\",\"role\":\"trainee\",\"password\":\"0123456789\"}", 400,
     "wrong_field", "trainee"},
    {"POST", "/accounts",
     "{\"name\":\"x\",\"role\":\"technician\",\"password\":\"0123456789\",\"trainee\":\"ada\"}",
     400, "wrong_field", "trainee"},
    {"PATCH", "/accounts/tom", "{}", 400, "wrong_body", "(none)"},
    {"PATCH", "/accounts/tom", "{\"role\":\"trainee\"}", 400, "wrong_field", "role"},
    {"PATCH", "/accounts/ada.l", "{\"role\":\"technician\"}", 400, "wrong_field", "role"},
    {"PATCH", "/accounts/none", "{\"role\":\"technician\"}", 404, "not_found", "(none)"},
    {"PATCH", "/accounts/tom", "{\"password\":\"short\"}", 400, "wrong_field", "password"},
    {"PATCH", "/accounts/grace", "{\"role\":\"technician\"}", 409, "conflict", "(none)"},
    {"DELETE", "/accounts/none", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/accounts/grace", NULL, 409, "conflict", "(none)"},
    {"DELETE", "/tokens/x", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/tokens/-1", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/tokens/99999999999999999999", NULL, 404, "not_found", "(none)"},
    {"POST", "/stations/none/code", "{}", 404, "not_found", "(none)"},
    {"POST", "/stations/room-1/revoke", "{}", 409, "conflict", "(none)"},
    {"POST", "/stations/none/attempt", "{\"task\":\"x\"}", 404, "not_found", "(none)"},
    {"POST", "/stations/room-1/attempt", "{\"hand\":\"left\"}", 400, "wrong_field", "task"},
    {"POST", "/stations/room-1/attempt", "{\"task\":\"centring\",\"hand\":\"third\"}", 400,
     "wrong_field", "hand"},
    {"POST", "/stations/room-1/attempt", "{\"task\":\"centring\",\"purpose\":\"\"}", 400,
     "wrong_field", "purpose"},
    {"DELETE", "/stations/room-1/attempt", NULL, 409, "conflict", "(none)"},
    {"POST", "/sign-in", "{\"name\":\"a\"}", 400, "wrong_field", "password"},
    {"POST", "/sign-in", "{\"name\":\"a\",\"password\":\"b\",\"code\":\"c\"}", 400, "wrong_field",
     "code"},
    {"PATCH", "/me", "{\"password\":\"x\"}", 400, "wrong_field", "new_password"},
    {"GET", "/sessions?limit=0", NULL, 400, "wrong_query", "limit"},
    {"GET", "/sessions?limit=501", NULL, 400, "wrong_query", "limit"},
    {"GET", "/sessions?limit=1e2", NULL, 400, "wrong_query", "limit"},
    {"GET", "/sessions?limit=1&limit=2", NULL, 400, "wrong_query", "(none)"},
    {"GET", "/sessions?order=asc", NULL, 400, "wrong_query", "(none)"},
    {"GET", "/sessions?before=1", NULL, 400, "wrong_query", "before"},
    {"GET", "/sessions?trainee=%4", NULL, 400, "wrong_query", "(none)"},
    {"GET", "/sessions?trainee=%00", NULL, 400, "wrong_query", "(none)"},
    {"GET", "/sessions?%", NULL, 400, "wrong_query", "(none)"},
    {"GET", "/distributions", NULL, 400, "wrong_query", "case"},
    {"GET", "/audit?limit=x", NULL, 400, "wrong_query", "limit"},
    {"GET", "/tasks/none", NULL, 404, "not_found", "(none)"},
    {"GET", "/tasks/none/mark", NULL, 404, "not_found", "(none)"},
    {"PUT", "/tasks/none/mark", "{}", 404, "not_found", "(none)"},
    {"PUT", "/tasks/steady/mark", "{}", 400, "wrong_field", "kind"},
    {"PUT", "/tasks/steady/mark", "[]", 400, "wrong_body", "(none)"},
    {"PUT", "/tasks/steady/mark", MARK("dice", "\"us\"", "30", "0", "0"), 400, "wrong_field",
     "(none)"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"\"", "30", "0", "0"), 400, "wrong_field",
     "source"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "null", "30", "0", "0"), 400, "wrong_field",
     "source"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"a\\nb\"", "30", "0", "0"), 400, "wrong_field",
     "(none)"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "0", "0", "0"), 400, "wrong_field",
     "time_s"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "1e9", "0", "0"), 400, "wrong_field",
     "time_s"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "\"30\"", "0", "0"), 400, "wrong_field",
     "time_s"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "30", "-1", "0"), 400, "wrong_field",
     "errors"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "30", "0.5", "0"), 400, "wrong_field",
     "errors"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "30", "0", "null"), 400, "wrong_field",
     "version"},
    {"PUT", "/tasks/steady/mark", MARK("by hand", "\"us\"", "30", "0", "1"), 409, "conflict",
     "(none)"},
    {"GET", "/tasks/steady/trials?time_s=x", NULL, 400, "wrong_query", "time_s"},
    {"GET", "/tasks/steady/trials?errors=-1", NULL, 400, "wrong_query", "errors"},
    {"GET", "/tasks/steady/contrast?upper=autumn", NULL, 400, "wrong_query", "lower"},
    {"GET", "/courses/none/curriculum", NULL, 404, "not_found", "(none)"},
    {"GET", "/courses/none/progress", NULL, 404, "not_found", "(none)"},
    {"PUT", "/courses/none/curriculum", PLAN("\"draft\"", "{\"task\":\"steady\"}"), 404,
     "not_found", "(none)"},
    {"PUT", "/courses/autumn/curriculum", "{}", 400, "wrong_field", "version"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"old\"", ""), 400, "wrong_field", "state"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", ""), 400, "wrong_field", "tasks"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "7"), 400, "wrong_field", "tasks"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "{}"), 400, "wrong_field", "task"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "{\"task\":\"none\"}"), 400,
     "wrong_field", "task"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "{\"task\":\"steady\",\"weak\":1}"),
     400, "wrong_field", "(none)"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "{\"task\":\"steady\",\"week\":0}"),
     400, "wrong_field", "week"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "{\"task\":\"steady\",\"passes\":11}"),
     400, "wrong_field", "passes"},
    {"PUT", "/courses/autumn/curriculum",
     PLAN("\"draft\"", "{\"task\":\"steady\",\"hands\":\"both\"}"), 400, "wrong_field", "hands"},
    {"PUT", "/courses/autumn/curriculum",
     PLAN("\"draft\"", "{\"task\":\"steady\",\"due_utc_s\":1e300}"), 400, "wrong_field",
     "due_utc_s"},
    {"PUT", "/courses/autumn/curriculum", PLAN("\"draft\"", "{\"task\":\"steady\",\"cases\":[7]}"),
     400, "wrong_field", "cases"},
    {"PUT", "/courses/autumn/curriculum",
     PLAN("\"draft\"", "{\"task\":\"steady\",\"after\":[\"steady\"]}"), 400, "wrong_field",
     "(none)"},
    {"PUT", "/courses/autumn/curriculum",
     PLAN("\"draft\"", "{\"task\":\"steady\"},{\"task\":\"steady\"}"), 400, "wrong_field",
     "(none)"},
    {"PUT", "/courses/autumn/curriculum", "{\"version\":0,\"state\":\"frozen\"}", 409, "conflict",
     "(none)"},
    {"PUT", "/courses/autumn/curriculum",
     "{\"version\":3,\"state\":\"draft\",\"tasks\":[{\"task\":\"steady\"}]}", 409, "conflict",
     "(none)"},
    {"GET", "/attempts?limit=501", NULL, 400, "wrong_query", "limit"},
    {"GET", "/attempts?before=7", NULL, 400, "wrong_query", "before"},
    {"GET", "/attempts?from=yesterday", NULL, 400, "wrong_query", "from"},
    {"GET", "/attempts?to=1e300", NULL, 400, "wrong_query", "to"},
    {"GET", "/attempts/" SESSION_ADA "/1", NULL, 404, "not_found", "(none)"},
    {"GET", "/attempts/" SESSION_ADA "/x", NULL, 404, "not_found", "(none)"},
    {"GET", "/attempts/none/99999999999", NULL, 404, "not_found", "(none)"},
    {"GET", "/curve", NULL, 400, "wrong_query", "task"},
    {"GET", "/curve?task=steady", NULL, 400, "wrong_query", "trainee"},
    {"GET", "/curve?task=none&trainee=ada", NULL, 404, "not_found", "(none)"},
    {"POST", "/attempts/" SESSION_ADA "/1/ratings", "{}", 400, "wrong_field", "safety"},
    {"POST", "/attempts/" SESSION_ADA "/1/ratings", RATING("6", "3"), 400, "wrong_field", "safety"},
    {"POST", "/attempts/" SESSION_ADA "/1/ratings", RATING("3.5", "3"), 400, "wrong_field",
     "safety"},
    {"POST", "/attempts/" SESSION_ADA "/1/ratings", RATING("3", "4"), 400, "wrong_field",
     "autonomy"},
    {"POST", "/attempts/" SESSION_ADA "/1/ratings", RATING("3", "3"), 404, "not_found", "(none)"},
    {"POST", "/exams", "{}", 400, "wrong_field", "course"},
    {"POST", "/exams", EXAM("winter", "\"steady\"", "\"healthy\"", ""), 404, "not_found", "(none)"},
    {"POST", "/exams", EXAM("autumn", "", "\"healthy\"", ""), 400, "wrong_field", "tasks"},
    {"POST", "/exams", EXAM("autumn", "\"steady\"", "", ""), 400, "wrong_field", "cases"},
    {"POST", "/exams", EXAM("autumn", "\"none\"", "\"healthy\"", ""), 400, "wrong_field", "tasks"},
    {"POST", "/exams", EXAM("autumn", "\"steady\"", "\"none\"", ""), 400, "wrong_field", "cases"},
    {"POST", "/exams", EXAM("autumn", "\"steady\"", "\"healthy\"", ",\"seed\":-1"), 400,
     "wrong_field", "seed"},
    {"POST", "/exams", EXAM("autumn", "\"steady\"", "\"healthy\"", ",\"hand\":\"third\""), 400,
     "wrong_field", "hand"},
    {"POST", "/exams", EXAM("autumn", "\"steady\"", "\"healthy\"", ",\"raters\":[\"tom\"]"), 400,
     "wrong_field", "(none)"},
    {"POST", "/exams",
     EXAM("autumn", "\"steady\"", "\"healthy\"", ",\"raters\":[\"a\",\"b\",\"c\"]"), 400,
     "wrong_field", "raters"},
    {"POST", "/exams/7/begin", "{\"who\":false}", 400, "wrong_field", "who"},
    {"POST", "/exams/7/begin",
     "{\"who\":true,\"station_check\":true,\"case_hash\":true,\"drift_mm\":2.5}", 400,
     "wrong_field", "drift_mm"},
    {"POST", "/exams/7/begin",
     "{\"who\":true,\"station_check\":true,\"case_hash\":true,\"drift_mm\":1}", 404, "not_found",
     "(none)"},
    {"POST", "/exams/7/interventions", "{\"reason\":\"x\"}", 400, "wrong_field", "reason"},
    {"POST", "/exams/7/interventions", "{\"reason\":\"a fall\"}", 404, "not_found", "(none)"},
    {"POST", "/exams/7/release", "{\"late\":true}", 400, "wrong_field", "(none)"},
    {"POST", "/exams/7/release", "{}", 404, "not_found", "(none)"},
    {"GET", "/exams/x", NULL, 404, "not_found", "(none)"},
    {"DELETE", "/exams/7", NULL, 404, "not_found", "(none)"},
};

static void who_trains_begins_an_attempt_in_an_own_session_alone(void **state) {
    (void)state;
    static const char path[] = "/stations/room-1/attempt";
    static const char body[] = "{\"task\":\"centring\",\"hand\":\"left\"}";
    assert_int_equal(ask("POST", path, token_of("grace"), body), 204);
    assert_int_equal(ask("POST", path, token_of("ada.l"), body), 204);
    assert_int_equal(ask("POST", "/stations/none/attempt", token_of("ada.l"), body), 409);
    assert_string_equal(error_code(), "conflict");
}

static void what_is_wrong_is_named(void **state) {
    (void)state;
    const char *token = token_of("grace");
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        int status = ask(wrong[i].method, wrong[i].path, token, wrong[i].body);
        if (status != wrong[i].status || strcmp(error_code(), wrong[i].code) ||
            strcmp(error_field(), wrong[i].field))
            fail_msg("%s %s %s: %d %s %s", wrong[i].method, wrong[i].path,
                     wrong[i].body ? wrong[i].body : "", status, error_code(), error_field());
        if (wrong[i].body)
            assert_true(strlen(text_at("error.text")) > 5);
        assert_null(strstr(text_at("error.text"), api_dir));
    }
}

static void a_body_that_is_too_large_is_refused(void **state) {
    (void)state;
    char *body = malloc(WEB_BODY_MAX + 100);
    const char *token = token_of("grace");
    memset(body, ' ', WEB_BODY_MAX + 100);
    strcpy(body + WEB_BODY_MAX, "{\"name\":\"a\"}");
    assert_int_equal(ask("POST", "/courses", token, body), 413);
    memset(body, 'a', WEB_BODY_MAX);
    memcpy(body, "{\"name\":\"", 9);
    strcpy(body + WEB_BODY_MAX - 2, "\"}");
    assert_int_equal(ask("POST", "/courses", token, body), 400);
    assert_string_equal(error_field(), "name");
    free(body);
}

int main(void) {
    const struct CMUnitTest tests[] = {
#define TEST(f) cmocka_unit_test_setup_teardown(f, api_begin, api_end)
        TEST(everybody_may_what_the_description_says_and_no_more),
        TEST(a_technician_manages_technicians_and_nobody_above),
        TEST(the_routes_are_those_of_the_description),
        TEST(a_path_that_is_none_is_not_found),
        TEST(who_trains_begins_an_attempt_in_an_own_session_alone),
        TEST(what_is_wrong_is_named),
        TEST(a_body_that_is_too_large_is_refused),
    };
    return cmocka_run_group_tests_name("api_roles", tests, NULL, NULL);
}
