#include "api/case_card.h"
#include "api/routes.h"
#include "base/clock.h"
#include "base/log.h"
#include "check/grade.h"
#include "net/authority.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

void get_server(struct call *call) {
    const struct api *api = call->api;
    struct authority_server server;
    authority_server(api->config.keys_dir, &server, NULL);
    double uptime_s = (double)((clock_now_ns() - api->started_ns) / NS_PER_MS) / 1000;
    call_answer(call, 200,
                json_pack("{s:s, s:f, s:f, s:i, s:i, s:o}", "version", ARTHRON_VERSION, "now_utc_s",
                          call_seconds(clock_utc_ns()), "uptime_s", uptime_s, "stations",
                          api->config.station_count, "cases", api->config.case_count,
                          "certificate_until_utc_s",
                          server.until_utc_s ? json_integer(server.until_utc_s) : json_null()));
}

// ---- stations -----------------------------------------------------------------------------------

static json_t *station_json(struct call *call, const struct api_station *station) {
    int64_t until_s = 0;
    struct error err;
    if (authority_station_until(call->api->config.keys_dir, station->name, &until_s, &err) !=
        RESULT_OK)
        log_error("api", "%s", err.text);
    return json_pack("{s:o, s:o, s:o, s:s, s:b, s:o}", "name", call_string(station->name), "case",
                     call_string(station->case_name), "trainee", call_string(station->trainee),
                     "start", station->start_by_command ? "command" : "auto", "enrolled",
                     until_s > 0, "certificate_until_utc_s",
                     until_s ? json_integer(until_s) : json_null());
}

void get_stations(struct call *call) {
    const struct api_config *config = &call->api->config;
    json_t *stations = json_array();
    for (int i = 0; i < config->station_count; i++)
        json_array_append_new(stations, station_json(call, &config->stations[i]));
    call_answer(call, 200, json_pack("{s:o}", "stations", stations));
}

// The station of the path, in the config; NULL after a refusal.
static const char *find_station(struct call *call) {
    static const char *const fields[] = {NULL};
    const struct api_config *config = &call->api->config;
    if (!call_take_body(call, fields))
        return NULL;
    for (int i = 0; i < config->station_count; i++)
        if (!strcmp(config->stations[i].name, call->args[0]))
            return config->stations[i].name;
    call_refuse(call, 404, "not_found", NULL, "The server's config has no station '%s'.",
                call->args[0]);
    return NULL;
}

// Before it is done, so that nothing is done that is not in the log.
static bool note(struct call *call, const char *action, const char *station) {
    char subject[STORE_TEXT_MAX];
    struct error err = {""};
    snprintf(subject, sizeof subject, "station %s", station);
    return call_went_well(call, store_note(call->store, action, subject, &err), &err);
}

void post_station_code(struct call *call) {
    char code[AUTHORITY_CODE_MAX];
    struct error err = {""};
    const char *station = find_station(call);
    if (!station || !note(call, "code", station))
        return;
    int64_t until_s = clock_utc_ns() / NS_PER_S + AUTHORITY_CODE_S;
    enum result result = authority_issue_code(call->api->config.keys_dir, station, code, &err);
    if (result == RESULT_MISSING) // the folder's fault, and not the request's
        result = RESULT_IO;
    if (call_went_well(call, result, &err))
        call_answer(call, 201,
                    json_pack("{s:s, s:I, s:i}", "code", code, "until_utc_s", (json_int_t)until_s,
                              "port", call->api->config.port));
}

void post_station_revoke(struct call *call) {
    struct error err = {""};
    const char *station = find_station(call);
    if (!station || !note(call, "revoke", station))
        return;
    enum result result = authority_revoke(call->api->config.keys_dir, station, &err);
    if (result == RESULT_MISSING)
        call_refuse(call, 409, "conflict", NULL, "Station %s has never had a certificate.",
                    station);
    else if (call_went_well(call, result, &err))
        call_done(call);
}

// ---- cases --------------------------------------------------------------------------------------

void get_cases(struct call *call) {
    char hash[17];
    call_close_store(call);
    json_t *cases = json_array();
    for (int i = 0; i < call->api->config.case_count; i++)
        json_array_append_new(cases, case_card(call->api->cards, i, hash));
    call_answer(call, 200, json_pack("{s:o}", "cases", cases));
}

// -1 after a refusal.
static int find_case(struct call *call) {
    call_close_store(call);
    for (int i = 0; i < call->api->config.case_count; i++)
        if (!strcmp(call->api->config.cases[i].name, call->args[0]))
            return i;
    call_refuse(call, 404, "not_found", NULL, "The server's config has no case '%s'.",
                call->args[0]);
    return -1;
}

void get_case(struct call *call) {
    char path[sizeof call->response->file], hash[17];
    int index = find_case(call);
    if (index < 0)
        return;
    snprintf(path, sizeof path, "%s/%s", call->api->config.cases[index].dir, GRADE_FILE);
    json_t *check = json_load_file(path, JSON_REJECT_DUPLICATES, NULL);
    call_answer(call, 200,
                json_pack("{s:o, s:o}", "case", case_card(call->api->cards, index, hash), "check",
                          check ? check : json_null()));
}

static void answer_file(struct call *call, const char *dir, const char *name, const char *type) {
    struct web_response *r = call->response;
    struct stat status;
    int length = snprintf(r->file, sizeof r->file, "%s/%s", dir, name);
    if (length >= (int)sizeof r->file || stat(r->file, &status) || !S_ISREG(status.st_mode)) {
        r->file[0] = '\0';
        call_refuse(call, 404, "not_found", NULL, "There is no %s.", name);
        return;
    }
    r->status = 200;
    r->compress = true;
    snprintf(r->type, sizeof r->type, "%s", type);
    snprintf(r->etag, sizeof r->etag, "%" PRIx64 "-%" PRIx64,
             (uint64_t)status.st_mtim.tv_sec * 1000000000 + (uint64_t)status.st_mtim.tv_nsec,
             (uint64_t)status.st_size);
}

// A file of the case itself, whose tag is the case's hash.
static void answer_case_file(struct call *call, const char *name, const char *type) {
    char hash[17];
    int index = find_case(call);
    if (index < 0)
        return;
    json_decref(case_card(call->api->cards, index, hash));
    answer_file(call, call->api->config.cases[index].dir, name, type);
    if (hash[0] && call->response->etag[0])
        snprintf(call->response->etag, sizeof call->response->etag, "%s", hash);
}

void get_case_manifest(struct call *call) {
    answer_case_file(call, "case.json", "application/json");
}

void get_case_anatomy(struct call *call) {
    answer_case_file(call, "anatomy.glb", "model/gltf-binary");
}

void get_case_check(struct call *call) {
    int index = find_case(call);
    if (index >= 0)
        answer_file(call, call->api->config.cases[index].dir, GRADE_FILE, "application/json");
}
