// Requests to /api/v1: "Xi none?limit=3", a line, then the body. X is a route of the room's table,
// from A on, whose * is what follows (any other letter: what follows is the path of a GET); i who
// asks: an instructor, a technician, the trainee ada (o), or nobody.
#include "api/routes.h"
#include "api/secret.h"
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "net/authority.h"
#include "store/store.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OF_ADA "0123456789abcdef0123456789abcdef"
#define OF_EVE "fedcba9876543210fedcba9876543210"

static char records[256], keys[256], cases_dir[256];
static char tokens[3][SECRET_MAX]; // of i, t and o

static const char people[] = "ito";

// ---- a server's folder --------------------------------------------------------------------------

static void put_session(struct store *store, const char *id, const char *trainee) {
    struct store_session s = {.start_utc_ns = 1000000000, .part = 1, .state = STATE_CLOSED};
    struct store_result result = {"time", "", 1, "s", 60, "{\"below_floor\":true}"};
    snprintf(s.id, sizeof s.id, "%s", id);
    snprintf(s.station, sizeof s.station, "room-1");
    snprintf(s.trainee, sizeof s.trainee, "%s", trainee);
    snprintf(s.case_name, sizeof s.case_name, "healthy");
    snprintf(s.trace, sizeof s.trace, "%s", fuzz_file("a.trace", "trace", 5));
    CHECK(store_put_session(store, &s, &result, 1, NULL) == RESULT_OK);
}

static void put_account(struct store *store, int number, const char *name, enum store_role role,
                        const char *trainee) {
    char hash[SECRET_MAX];
    struct store_principal owner;
    int64_t id, until_ns;
    CHECK(store_add_account(store, name, role, "$argon2id$v=19$m=8,t=1,p=1$c29tZXNhbHQ$aGFzaA",
                            trainee, NULL) == RESULT_OK);
    CHECK(store_find_account(store, name, &owner, NULL) == RESULT_OK);
    secret_make(tokens[number]);
    secret_hash(tokens[number], hash);
    CHECK(store_add_token(store, TOKEN_BEARER, hash, &owner, NULL, &id, &until_ns, NULL) ==
          RESULT_OK);
}

static void put_records(void) {
    struct store *store;
    CHECK(store_open(records, STORE_MAKE, "fuzz", &store, NULL) == RESULT_OK);
    put_session(store, OF_ADA, "ada");
    put_session(store, OF_EVE, "eve");
    CHECK(store_add_course(store, "autumn", NULL) == RESULT_OK);
    CHECK(store_enrol(store, "ada", "autumn", NULL) == RESULT_OK);
    put_account(store, 0, "grace", ROLE_INSTRUCTOR, NULL);
    put_account(store, 1, "tom", ROLE_TECHNICIAN, NULL);
    put_account(store, 2, "ada", ROLE_TRAINEE, "ada");
    store_close(&store);
}

static enum result report(void *user, const struct api_report *about, FILE *file,
                          struct error *err) {
    (void)user;
    (void)err;
    fputs(about->trace, file);
    return RESULT_OK;
}

static void figures(void *user, bool openmetrics, FILE *file) {
    (void)user;
    fputs(openmetrics ? "open" : "plain", file);
}

static bool is_well(void *user, char why[API_WHY_MAX]) {
    (void)user, (void)why;
    return true;
}

// A new one each time, for what was asked before changed it and made some wait.
static struct api *begin(void) {
    static const char *const hosts[] = {"localhost"};
    static struct api_case cases[1] = {{"healthy", cases_dir}};
    static const struct api_station stations[1] = {{"room-1", "healthy", "ada", false}};
    const struct api_config config = {.records = records,
                                      .keys_dir = keys,
                                      .link = "https://localhost/",
                                      .cases = cases,
                                      .case_count = 1,
                                      .stations = stations,
                                      .station_count = 1,
                                      .report = report,
                                      .write_figures = figures,
                                      .lives = is_well,
                                      .is_ready = is_well};
    struct api *api;
    if (!records[0]) {
        snprintf(keys, sizeof keys, "%s/keys", fuzz_folder());
        snprintf(cases_dir, sizeof cases_dir, "%s", fuzz_folder());
        CHECK(authority_init(keys, hosts, 1, NULL) == RESULT_OK);
    }
    char old[512];
    for (const char *end = ""; end; end = !*end ? "-wal" : !strcmp(end, "-wal") ? "-shm" : NULL) {
        snprintf(old, sizeof old, "%s/records.db%s", fuzz_folder(), end);
        remove(old);
    }
    snprintf(records, sizeof records, "%s/records.db", fuzz_folder());
    put_records();
    CHECK(api_create(&config, &api, NULL) == RESULT_OK);
    return api;
}

// ---- what is promised ---------------------------------------------------------------------------

static void check_json(const struct web_response *r) {
    json_t *json = json_loadb(r->body, r->size, JSON_REJECT_DUPLICATES, NULL);
    CHECK(json_is_object(json));
    json_t *error = json_object_get(json, "error");
    CHECK((r->status >= 400) == (error != NULL));
    CHECK(!error || (json_is_string(json_object_get(error, "code")) &&
                     json_is_string(json_object_get(error, "text"))));
    json_decref(json);
}

static void check_answer(const struct web_response *r, char who) {
    static const int statuses[] = {200, 201, 204, 400, 401, 403, 404, 405, 409, 413, 429, 503};
    bool known = false;
    for (size_t i = 0; i < sizeof statuses / sizeof *statuses; i++)
        known = known || r->status == statuses[i];
    CHECK(known);
    CHECK(r->status == 204 || r->body || r->file[0]);
    static const char description[] = "{\"openapi\":", no_sign_on[] = "{\"name\":null}";
    bool is_public = r->body && (!strcmp(r->body, "ok\n") || !strcmp(r->body, no_sign_on) ||
                                 !strncmp(r->body, description, sizeof description - 1));
    CHECK(who != '-' || r->status >= 400 || r->status == 204 || is_public); // 204: of signing out
    if (r->body && !r->type[0])
        check_json(r);
    CHECK(!strstr(r->file, "..") &&
          (!r->file[0] || !strncmp(r->file, cases_dir, strlen(cases_dir))));
    if (r->body && r->status < 400 && who == 'o')
        CHECK(!memmem(r->body, r->size, OF_EVE, strlen(OF_EVE)));
}

// The route's path with `part` for its *.
static void write_path(const struct route *route, const char *part, char *out, size_t size) {
    const char *star = route ? strchr(route->path, '*') : NULL;
    if (!route)
        snprintf(out, size, API_PREFIX "%s", part);
    else if (star)
        snprintf(out, size, API_PREFIX "%.*s%s%s", (int)(star - route->path), route->path, part,
                 star + 1);
    else
        snprintf(out, size, API_PREFIX "%s", route->path);
}

static void ask(struct api *api, char *line, const char *body, size_t size) {
    char path[700];
    struct web_response response = {0};
    int number = (unsigned char)line[0] - 'A';
    const struct route *route = number >= 0 && number < route_count ? &routes[number] : NULL;
    const char *who = line[1] ? strchr(people, line[1]) : NULL;
    char *part = strlen(line) > 3 ? line + 3 : line + strlen(line), *query = strchr(part, '?');
    if (query)
        *query++ = '\0';
    write_path(route, part, path, sizeof path);
    const struct web_request request = {.method = route ? route->method : "GET",
                                        .path = path,
                                        .query = query ? query : "",
                                        .body = body,
                                        .size = size,
                                        .token = who ? tokens[who - people] : NULL,
                                        .address = "10.0.0.5"};
    api_answer(api, &request, &response);
    check_answer(&response, who ? *who : '-');
    free(response.body);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct api *api;
    static int asked;
    char line[600] = "", *copy = alloc(size + 1, 1);
    size_t first, rest;
    const uint8_t *body = fuzz_split(data, size, '\n', &first, &rest);
    if (asked++ % 500 == 0) {
        api_destroy(&api);
        api = begin();
    }
    if (first && first < sizeof line)
        memcpy(line, data, first);
    memcpy(copy, body, rest); // with a 0 behind, as the web room gives it
    ask(api, line, copy, rest);
    free(copy);
    return 0;
}
