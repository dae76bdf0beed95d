#include "api/routes.h"
#include "base/clock.h"
#include "base/log.h"
#include "net/authority.h"

#include <stdio.h>
#include <string.h>

void get_server(struct api_call *call) {
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

static json_t *station_json(struct api_call *call, const struct api_station *station) {
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

void get_stations(struct api_call *call) {
    const struct api_config *config = &call->api->config;
    json_t *stations = json_array();
    for (int i = 0; i < config->station_count; i++)
        json_array_append_new(stations, station_json(call, &config->stations[i]));
    call_answer(call, 200, json_pack("{s:o}", "stations", stations));
}

// The station of the path, in the config; NULL after a refusal.
static const char *find_station(struct api_call *call) {
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
static bool note(struct api_call *call, const char *action, const char *station) {
    char subject[STORE_TEXT_MAX];
    struct error err = {""};
    snprintf(subject, sizeof subject, "station %s", station);
    return call_check(call, store_note(call->store, action, subject, &err), &err);
}

void post_station_code(struct api_call *call) {
    char code[AUTHORITY_CODE_MAX];
    struct error err = {""};
    const char *station = find_station(call);
    if (!station || !note(call, "code", station))
        return;
    int64_t until_s = clock_utc_ns() / NS_PER_S + AUTHORITY_CODE_S;
    enum result result = authority_issue_code(call->api->config.keys_dir, station, code, &err);
    if (result == RESULT_MISSING) // the folder's fault, and not the request's
        result = RESULT_IO;
    if (call_check(call, result, &err))
        call_answer(call, 201,
                    json_pack("{s:s, s:I, s:i}", "code", code, "until_utc_s", (json_int_t)until_s,
                              "port", call->api->config.port));
}

void post_station_revoke(struct api_call *call) {
    struct error err = {""};
    const char *station = find_station(call);
    if (!station || !note(call, "revoke", station))
        return;
    enum result result = authority_revoke(call->api->config.keys_dir, station, &err);
    if (result == RESULT_MISSING)
        call_refuse(call, 409, "conflict", NULL, "Station %s has never had a certificate.",
                    station);
    else if (call_check(call, result, &err))
        call_done(call);
}
