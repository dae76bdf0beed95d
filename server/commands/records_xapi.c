#include "commands/records_xapi.h"

#include "base/clock.h"
#include "commands/records_rows.h"
#include "xapi/words.h"

#include <string.h>

static const char *text_in_row(const json_t *row, const char *column) {
    return json_string_value(json_object_get(row, column));
}

static int64_t number_of(const json_t *row, const char *column) {
    return json_integer_value(json_object_get(row, column));
}

// ---- parts of a statement -----------------------------------------------------------------------

static json_t *object(const json_t *session, const char *site) {
    char iri[XAPI_IRI_MAX];
    xapi_iri(site, "cases", text_in_row(session, "case"), iri);
    size_t used = strlen(iri);
    snprintf(iri + used, sizeof iri - used, "/%s", text_in_row(session, "case_hash"));
    return json_pack("{s:s, s:s, s:{s:{s:s}, s:s}}", "objectType", "Activity", "id", iri,
                     "definition", "name", "en", text_in_row(session, "case"), "type",
                     XAPI_ACTIVITY_TYPE "simulation");
}

static json_t *results_of(const json_t *results, const char *id) {
    json_t *own = json_object_get(results, id);
    return own ? json_incref(own) : json_array();
}

static json_t *outcome(const json_t *session, const json_t *results, const char *site) {
    char duration[32];
    int64_t lasted_ns = number_of(session, "end_utc_ns") - number_of(session, "start_utc_ns");
    xapi_duration((double)lasted_ns / (double)NS_PER_S, duration);
    bool closed = !strcmp(text_in_row(session, "state"), "closed");
    return json_pack(
        "{s:b, s:s, s:o}", "completion", closed, "duration", duration, "extensions",
        xapi_extension(site, "results", results_of(results, text_in_row(session, "id"))));
}

static json_t *context(const json_t *session, const char *site, const char *uuid) {
    const char *trace = strrchr(text_in_row(session, "trace"), '/');
    json_t *evidence = json_pack(
        "{s:s, s:s?, s:s?, s:s, s:s, s:O, s:O}", "file",
        trace ? trace + 1 : text_in_row(session, "trace"), "hash",
        text_in_row(session, "trace_hash"), "xxh3", text_in_row(session, "trace_xxh3"), "session",
        text_in_row(session, "id"), "station", text_in_row(session, "station"), "steps",
        json_object_get(session, "steps"), "missing", json_object_get(session, "missing"));
    return json_pack("{s:s, s:s, s:o}", "registration", uuid, "platform",
                     "arthron-server " ARTHRON_VERSION, "extensions",
                     xapi_extension(site, "trace", evidence));
}

static json_t *statement(const json_t *session, const json_t *results, const char *site) {
    char uuid[37], when[32];
    bool closed = !strcmp(text_in_row(session, "state"), "closed");
    xapi_session_uuid(text_in_row(session, "id"), uuid);
    clock_utc_text(number_of(session, "end_utc_ns"), when);
    return json_pack("{s:s, s:o, s:o, s:o, s:o, s:o, s:s, s:s}", "id", uuid, "actor",
                     xapi_actor(site, text_in_row(session, "trainee")), "verb",
                     xapi_verb(closed ? "completed" : "attempted"), "object", object(session, site),
                     "result", outcome(session, results, site), "context",
                     context(session, site, uuid), "timestamp", when, "version", XAPI_VERSION);
}

// ---- all of them --------------------------------------------------------------------------------

// { session: [ {metric, ...}, ... ] }
static json_t *by_session(json_t *rows) {
    json_t *grouped = json_object(), *row;
    size_t i;
    json_array_foreach(rows, i, row) {
        const char *id = text_in_row(row, "session");
        json_t *details = json_object_get(row, "details");
        json_t *parsed =
            json_is_string(details) ? json_loads(json_string_value(details), 0, NULL) : NULL;
        if (parsed)
            json_object_set_new(row, "details", parsed);
        if (!json_object_get(grouped, id))
            json_object_set_new(grouped, id, json_array());
        json_array_append(json_object_get(grouped, id), row);
    }
    return grouped;
}

static bool has_statement(const json_t *session) {
    return text_in_row(session, "trainee") &&
           json_is_integer(json_object_get(session, "end_utc_ns"));
}

static json_t *all_statements(json_t *sessions, json_t *results, const char *site, int *out_left) {
    json_t *statements = json_array(), *grouped = by_session(results), *session;
    size_t i;
    *out_left = 0;
    json_array_foreach(sessions, i, session) {
        if (has_statement(session))
            json_array_append_new(statements, statement(session, grouped, site));
        else
            ++*out_left;
    }
    json_decref(grouped);
    return statements;
}

static enum result write_json(const json_t *json, const char *path, struct error *err) {
    FILE *file;
    enum result result = rows_create(path, &file, err);
    if (result != RESULT_OK)
        return result;
    json_dumpf(json, file, JSON_INDENT(1));
    putc('\n', file);
    return rows_close(file, path, err);
}

enum result xapi_export(struct store *store, const char *path, const char *site, int *out_left,
                        struct error *err) {
    enum result result = xapi_check_site(site, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "--site ");
    json_t *sessions = json_array(), *results = json_array();
    result = store_rows(store, LIST_SESSIONS, NULL, rows_take, sessions, err);
    if (result == RESULT_OK)
        result = store_rows(store, LIST_RESULTS, NULL, rows_take, results, err);
    if (result == RESULT_OK) {
        json_t *statements = all_statements(sessions, results, site, out_left);
        result = write_json(statements, path, err);
        json_decref(statements);
    }
    json_decref(sessions);
    json_decref(results);
    return result;
}
