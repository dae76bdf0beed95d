#include "api/attempts.h"
#include "api/revoke.h"
#include "api/routes.h"
#include "base/attempt_words.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "net/authority.h"
#include "store/exams.h"

#include <stdio.h>
#include <stdlib.h>
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

// A rater of an exam that goes on is not told that its trainee stands there. A refusal counts as
// such.
static bool is_blind_to(struct api_call *call, const char *trainee) {
    struct error err = {""};
    bool blind = false;
    if (!attempt_rater(call))
        return false;
    enum result result = store_is_blind_to(call->store, attempt_rater(call), trainee, &blind, &err);
    return !call_check(call, result, &err) || blind;
}

static json_t *station_json(struct api_call *call, const struct api_station *station) {
    int64_t until_s = 0;
    struct error err;
    if (authority_station_until(call->api->config.keys_dir, station->name, &until_s, &err) !=
        RESULT_OK)
        log_error("api", "%s", err.text);
    return json_pack(
        "{s:o, s:o, s:o, s:s, s:b, s:o}", "name", call_string(station->name), "case",
        call_string(station->case_name), "trainee",
        is_blind_to(call, station->trainee) ? json_null() : call_string(station->trainee), "start",
        station->start_by_command ? "command" : "auto", "enrolled", until_s > 0,
        "certificate_until_utc_s", until_s ? json_integer(until_s) : json_null());
}

void get_stations(struct api_call *call) {
    const struct api_config *config = &call->api->config;
    json_t *stations = json_array();
    for (int i = 0; i < config->station_count; i++)
        json_array_append_new(stations, station_json(call, &config->stations[i]));
    if (call->response->status) // refused
        json_decref(stations);
    else
        call_answer(call, 200, json_pack("{s:o}", "stations", stations));
}

// Its name in the config; NULL: there is none.
static const char *station_named(const struct api_config *config, const char *name) {
    for (int i = 0; i < config->station_count; i++)
        if (!strcmp(config->stations[i].name, name))
            return config->stations[i].name;
    return NULL;
}

static void refuse_station(struct api_call *call) {
    call_refuse(call, 404, "not_found", NULL, "The server's config has no station '%s'.",
                call->args[0]);
}

// The station of the path; NULL after a refusal.
static const char *find_station(struct api_call *call) {
    static const char *const fields[] = {NULL};
    if (!call_take_body(call, fields))
        return NULL;
    const char *station = station_named(&call->api->config, call->args[0]);
    if (!station)
        refuse_station(call);
    return station;
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
    char serials[AUTHORITY_SERIALS_SIZE] = "";
    struct error err = {""};
    const char *station = find_station(call);
    if (!station || !note(call, "revoke", station))
        return;
    enum result result = authority_revoke_all(call->api->config.keys_dir, station, serials, &err);
    if (result == RESULT_MISSING)
        result = RESULT_OK; // another server may have issued one
    if (!call_check(call, result, &err))
        return;
    if (call->api->config.cluster)
        revoke_elsewhere(call, station, serials);
    else
        revoke_answer(call->response, station, serials, "");
}

// ---- attempts -----------------------------------------------------------------------------------

// The sessions decide.
static void obey(struct api_call *call, const arthron_Command *command) {
    const struct api_config *config = &call->api->config;
    arthron_CommandReply *reply = alloc(1, sizeof *reply);
    call_close_store(call);
    config->command(config->user, call->principal.actor, command, reply);
    if (reply->ok)
        call_done(call);
    else
        call_refuse(call, 409, "conflict", NULL, "%s.", reply->text);
    free(reply);
}

// To a trainee, a station that is not there is one without an own session.
static void command_station(struct api_call *call, arthron_Command *command) {
    bool is_trainee = call->principal.role == ROLE_TRAINEE;
    bool is_there = station_named(&call->api->config, call->args[0]);
    bool may_own = is_there && call->principal.trainee[0];
    snprintf(command->station, sizeof command->station, "%s", call->args[0]);
    if (is_trainee)
        snprintf(command->trainee, sizeof command->trainee, "%s", call->principal.trainee);
    if (is_trainee && !may_own)
        call_refuse(call, 409, "conflict", NULL, "station %s: it has no session of yours.",
                    call->args[0]);
    else if (is_there)
        obey(call, command);
    else
        refuse_station(call);
}

static bool take_word(struct api_call *call, const char *field, int (*from)(const char *),
                      int *in_out) {
    const char *text = call_text(call, field);
    int index = text ? from(text) : *in_out;
    if (index < 0)
        call_refuse(call, 400, "wrong_field", field, "'%s' is none of its values.", text);
    *in_out = index;
    return index >= 0;
}

void post_station_attempt(struct api_call *call) {
    static const char *const fields[] = {"task", "purpose", "hand", NULL};
    arthron_Command command = {.kind = arthron_Command_Kind_BEGIN};
    const char *task;
    int purpose = ATTEMPT_PRACTICE, hand = ATTEMPT_RIGHT;
    if (!call_take_body(call, fields) || !call_need_name(call, "task", &task) ||
        !take_word(call, "purpose", attempt_purpose_from, &purpose) ||
        !take_word(call, "hand", attempt_hand_from, &hand))
        return;
    command.purpose = (arthron_AttemptState_Purpose)purpose;
    command.hand = (arthron_AttemptState_Hand)hand;
    if (snprintf(command.task, sizeof command.task, "%s", task) >= (int)sizeof command.task)
        call_refuse(call, 409, "conflict", "task", "There is no task '%s'.", task);
    else
        command_station(call, &command);
}

void delete_station_attempt(struct api_call *call) {
    command_station(call, &(arthron_Command){.kind = arthron_Command_Kind_LEAVE});
}
