#include "unit/api_files.h"

#include "api/secret.h"
#include "base/check.h"
#include "net/authority.h"
#include "test.h"
#include "unit/case_knee.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct api *the_api;
char api_dir[FOLDER_MAX];
struct web_response answer;
const char *device;
json_t *said;
case_checker api_checker;
void (*api_on_report)(void);

static struct error err;
static char records[FOLDER_MAX + 32], keys[FOLDER_MAX + 32], dirs[2][FOLDER_MAX + 32];
static struct api_case cases[2];
static const struct task tasks[] = {
    {.name = "steady",
     .title = "Steady camera",
     .briefing = "Hold it still.",
     .version = 1,
     .limit_s = 60,
     .pass_time_s = 30,
     .source = "Set by hand.",
     .goal_count = 1,
     .goals = {{.name = "still", .see = "notch"}}},
    {.name = "probing",
     .title = "Probe in order",
     .briefing = "Touch two places.",
     .version = 3,
     .limit_s = 120,
     .in_order = true,
     .pass_time_s = 60,
     .pass_errors = 1,
     .source = "Faculty, n = 5",
     .goal_count = 2,
     .goals = {{.name = "horn", .touch = "horn", .tool = "probe", .reach_mm = 3, .rim_mm = NAN},
               {.name = "root", .touch = "root", .tool = "probe"}},
     .error_count = 1,
     .errors = {{.name = "deep", .sentinel = true}}}};
static const struct api_station stations[] = {{"room-1", "healthy", "ada", false},
                                              {"room-2", "torn", "", true}};

const char *in_api(const char *name) {
    static char paths[4][FOLDER_MAX + 64];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", api_dir, name);
    return path;
}

struct store *api_store(void) {
    struct store *store;
    assert_ok(store_open(records, STORE_MAKE, "tester", &store, &err));
    return store;
}

// ---- the folder ---------------------------------------------------------------------------------

static void put_session(struct store *store, const char *id, const char *trainee,
                        const char *case_name, int number) {
    struct store_session s = {.case_hash = 7,
                              .part = 1,
                              .start_utc_ns = (1000 + number) * 1000000000LL,
                              .end_utc_ns = (1060 + number) * 1000000000LL,
                              .state = STATE_CLOSED,
                              .steps = 100};
    struct store_result results[] = {{"time", "", 1, "s", 60 + number, "{\"below_floor\":true}"},
                                     {"rim", "meniscus_medial", 2, "mm", NAN, ""}};
    char name[64], text[80];
    snprintf(s.id, sizeof s.id, "%s", id);
    snprintf(s.station, sizeof s.station, "room-1");
    snprintf(s.trainee, sizeof s.trainee, "%s", trainee);
    snprintf(s.case_name, sizeof s.case_name, "%s", case_name);
    snprintf(name, sizeof name, "%d.trace", number);
    snprintf(s.trace, sizeof s.trace, "%s", in_api(name));
    snprintf(text, sizeof text, "trace of %s", id);
    write_file(api_dir, name, text, strlen(text));
    assert_ok(store_put_session(store, &s, results, 2, &err));
}

static void put_people(struct store *store) {
    assert_ok(store_add_trainee(store, "ada", "Ada Lovelace", &err));
    assert_ok(store_add_trainee(store, "eve", NULL, &err));
    assert_ok(store_add_course(store, "autumn", &err));
    assert_ok(store_add_course(store, "winter", &err));
    assert_ok(store_enrol(store, "ada", "autumn", &err));
    put_session(store, SESSION_ADA, "ada", "healthy", 1);
    put_session(store, SESSION_EVE, "eve", "healthy", 2);
    put_session(store, SESSION_NOBODY, "", "torn", 3);
}

static void put_accounts(struct store *store) {
    assert_ok(store_add_account(store, "grace", ROLE_INSTRUCTOR, NO_PASSWORD, NULL, &err));
    assert_ok(store_add_account(store, "tom", ROLE_TECHNICIAN, NO_PASSWORD, NULL, &err));
    assert_ok(store_add_account(store, "ada.l", ROLE_TRAINEE, NO_PASSWORD, "ada", &err));
}

static void put_cases(void) {
    struct knee_case *knee = box_knee();
    cases[0] = (struct api_case){"healthy", dirs[0]};
    cases[1] = (struct api_case){"torn", dirs[1]};
    assert_ok(case_save(knee, dirs[0], &err));
    case_destroy(&knee);
    assert_int_equal(mkdir(dirs[1], 0700), 0);
}

static enum result report(void *user, const struct api_report *about, FILE *file,
                          struct error *why) {
    (void)user;
    char text[80];
    if (api_on_report)
        api_on_report();
    FILE *in = fopen(about->trace, "r");
    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = '\0';
    fclose(in);
    if (strstr(text, "bad"))
        return (fail)(why, RESULT_CORRUPT, "%s: damaged", about->trace);
    fprintf(file, "<p>%s beside %s%s</p>", text,
            !about->records ? "nobody"
            : about->course ? about->course
                            : "all",
            about->hide_few ? ", if many" : "");
    return RESULT_OK;
}

// The session of room-1 is ada's, and no attempt runs.
static void obey(void *user, const char *actor, const arthron_Command *command,
                 arthron_CommandReply *out_reply) {
    (void)user;
    bool begins = command->kind == arthron_Command_Kind_BEGIN;
    bool own = !command->trainee[0] || !strcmp(command->trainee, "ada");
    *out_reply = (arthron_CommandReply){.ok = actor[0] && own && begins};
    if (begins && own)
        assert_string_equal(command->task, "centring");
    snprintf(out_reply->text, sizeof out_reply->text, "%s",
             own ? "station room-1: no attempt runs" : "it has no session of yours");
}

int api_released;

static void take_released(void *user, struct store *store, const char *session, int number) {
    (void)user, (void)store;
    assert_string_equal(session, SESSION_ADA);
    api_released += number > 0;
}

int api_rehearsed;
bool api_rehearse_fails;
void (*api_on_rehearse)(void);

static enum result compute_hands(void *user, int task, int knee_case, uint8_t **out_batch,
                                 size_t *out_size, struct error *why) {
    (void)user;
    api_rehearsed++;
    if (api_on_rehearse)
        api_on_rehearse();
    if (api_rehearse_fails)
        return (fail)(why, RESULT_LIMIT, "it took too long");
    if (task || knee_case)
        return (fail)(why, RESULT_MISSING, "the hands cannot do it");
    *out_batch = alloc(5, 1);
    memcpy(*out_batch, "hands", *out_size = 5);
    return RESULT_OK;
}

static void figures(void *user, bool openmetrics, FILE *file) {
    (void)user;
    fputs(openmetrics ? "open" : "plain", file);
}

static bool lives(void *user, char why[API_WHY_MAX]) {
    (void)user, (void)why;
    return true;
}

static bool is_ready(void *user, char why[API_WHY_MAX]) {
    (void)user;
    snprintf(why, API_WHY_MAX, "it is not");
    return false;
}

const struct api_cluster *api_cluster;
bool api_passed_on;

void api_restart(void) {
    static const char link[] = "https://server.example.org:4880/";
    const struct api_config config = {
        records, keys,        link,  cases,   2,    stations,      2,    report,        4810,
        NULL,    api_checker, tasks, 2,       obey, take_released, NULL, compute_hands, api_cluster,
        NULL,    figures,     lives, is_ready};
    api_destroy(&the_api);
    assert_ok(api_create(&config, &the_api, &err));
}

static void begin(bool with_accounts) {
    static const char *const hosts[] = {"localhost"};
    folder_make_in_memory(api_dir);
    snprintf(records, sizeof records, "%s", in_api("records.db"));
    snprintf(keys, sizeof keys, "%s", in_api("keys"));
    snprintf(dirs[0], sizeof dirs[0], "%s", in_api("healthy"));
    snprintf(dirs[1], sizeof dirs[1], "%s", in_api("torn"));
    assert_ok(authority_init(keys, hosts, 1, &err));
    put_cases();
    struct store *store = api_store();
    put_people(store);
    if (with_accounts)
        put_accounts(store);
    store_close(&store);
    api_restart();
}

int api_begin(void **state) {
    (void)state;
    begin(true);
    return 0;
}

int api_begin_new(void **state) {
    (void)state;
    begin(false);
    return 0;
}

static void forget_answer(void) {
    json_decref(said);
    said = NULL;
    free(answer.body);
    answer = (struct web_response){0};
}

int api_end(void **state) {
    (void)state;
    forget_answer();
    api_destroy(&the_api);
    folder_remove(api_dir);
    return 0;
}

// ---- tokens -------------------------------------------------------------------------------------

static const char *add_token(struct store *store, enum store_token_kind kind,
                             const struct store_principal *owner) {
    static char tokens[4][SECRET_MAX];
    static int next;
    char *token = tokens[next++ % 4], hash[SECRET_MAX];
    int64_t id, until_ns;
    secret_make(token);
    secret_hash(token, hash);
    assert_ok(store_add_token(store, kind, hash, owner, NULL, &id, &until_ns, &err));
    store_close(&store);
    return token;
}

const char *token_of(const char *account) {
    struct store_principal owner;
    struct store *store = api_store();
    assert_ok(store_find_account(store, account, &owner, &err));
    return add_token(store, TOKEN_COOKIE, &owner);
}

const char *token_of_code(const char *trainee) {
    struct store_principal owner;
    struct store *store = api_store();
    int64_t until_ns;
    char code[SECRET_MAX], hash[SECRET_MAX];
    secret_make(code);
    secret_hash(code, hash);
    assert_ok(store_add_code(store, trainee, hash, &until_ns, &err));
    assert_ok(store_find_code(store, hash, &owner, &err));
    return add_token(store, TOKEN_COOKIE, &owner);
}

// ---- requests -----------------------------------------------------------------------------------

int ask_from(const char *address, const char *method, const char *path, const char *token,
             const char *body) {
    char whole[512];
    snprintf(whole, sizeof whole, "/api/v1%s", path);
    char *query = strchr(whole, '?');
    if (query)
        *query++ = '\0';
    const struct web_request request = {.method = method,
                                        .path = whole,
                                        .query = query ? query : "",
                                        .body = body ? body : "",
                                        .size = body ? strlen(body) : 0,
                                        .token = token,
                                        .by_cookie = true,
                                        .device = device,
                                        .is_passed_on = api_passed_on,
                                        .address = address};
    struct web_response made = {0};
    api_answer(the_api, &request, &made);
    if (made.later) {
        struct web_response later = {0};
        made.later(made.later_data, &later);
        made = later;
    }
    forget_answer(); // also what was asked meanwhile
    answer = made;
    if (answer.body && !answer.type[0]) {
        said = json_loadb(answer.body, answer.size, 0, NULL);
        assert_non_null(said);
    }
    assert_true(answer.status == 204 || answer.body || answer.file[0]);
    return answer.status;
}

int ask(const char *method, const char *path, const char *token, const char *body) {
    return ask_from("10.0.0.5", method, path, token, body);
}

static json_t *value_at(const char *path) {
    char part[64];
    json_t *value = said;
    while (value && *path) {
        size_t length = strcspn(path, ".");
        snprintf(part, sizeof part, "%.*s", (int)length, path);
        value = json_is_array(value) ? json_array_get(value, (size_t)atoi(part))
                                     : json_object_get(value, part);
        path += length + (path[length] == '.');
    }
    return value;
}

const char *text_at(const char *path) {
    const char *text = json_string_value(value_at(path));
    return text ? text : "(none)";
}

double number_at(const char *path) {
    json_t *value = value_at(path);
    return json_is_number(value) ? json_number_value(value) : (double)NAN;
}

void api_wait_for_cases(const char *token) {
    for (int i = 0; i < 5000; i++) {
        assert_int_equal(ask("GET", "/cases", token, NULL), 200);
        if (!strstr(answer.body, "the server is reading it"))
            return;
        usleep(1000);
    }
    fail_msg("the cases are still being read");
}

size_t count_at(const char *key) {
    return json_array_size(json_object_get(said, key));
}

void give_password(const char *account) {
    struct store *store = api_store();
    assert_int_equal(store_set_password(store, account, ENCODED, &err), RESULT_OK);
    store_close(&store);
}

int sign_in(const char *name, const char *password) {
    char body[2048];
    snprintf(body, sizeof body, "{\"name\":\"%s\",\"password\":\"%s\"}", name, password);
    return ask("POST", "/sign-in", NULL, body);
}

const char *error_code(void) {
    const char *code = json_string_value(value_at("error.code"));
    return code ? code : "";
}

const char *error_field(void) {
    return text_at("error.field");
}
