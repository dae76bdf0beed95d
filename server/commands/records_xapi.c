#include "commands/records_xapi.h"

#include "base/clock.h"
#include "commands/records_rows.h"

#include <ctype.h>
#include <string.h>

#define IRI_MAX 1024
#define VERB "http://adlnet.gov/expapi/verbs/"
#define ACTIVITY_TYPE "http://adlnet.gov/expapi/activities/simulation"

static const char *text_of(const json_t *row, const char *column) {
    return json_string_value(json_object_get(row, column));
}

static int64_t number_of(const json_t *row, const char *column) {
    return json_integer_value(json_object_get(row, column));
}

// RFC 4122, version 4: a session's id is by chance but for these bits.
static void uuid_of(const char *id, char out[37]) {
    static const char variants[] = "89ab";
    snprintf(out, 37, "%.8s-%.4s-4%.3s-%c%.3s-%.12s", id, id + 8, id + 13,
             variants[(id[16] <= '9' ? id[16] - '0' : id[16] - 'a' + 10) & 3], id + 17, id + 20);
}

static void append_encoded(const char *text, char *out, size_t size) {
    size_t used = strlen(out);
    for (; *text && used + 4 < size; text++) {
        unsigned char c = (unsigned char)*text;
        if (c < 0x80 && (isalnum(c) || strchr("-._~", c)))
            used += (size_t)snprintf(out + used, size - used, "%c", c);
        else
            used += (size_t)snprintf(out + used, size - used, "%%%02X", c);
    }
}

// ---- parts of a statement -----------------------------------------------------------------------

static json_t *actor(const json_t *session, const char *site) {
    return json_pack("{s:s, s:{s:s, s:s}}", "objectType", "Agent", "account", "homePage", site,
                     "name", text_of(session, "trainee"));
}

static json_t *verb(const json_t *session) {
    const char *name = strcmp(text_of(session, "state"), "closed") ? "attempted" : "completed";
    char iri[64];
    snprintf(iri, sizeof iri, VERB "%s", name);
    return json_pack("{s:s, s:{s:s}}", "id", iri, "display", "en", name);
}

static json_t *object(const json_t *session, const char *site) {
    char iri[IRI_MAX];
    snprintf(iri, sizeof iri, "%s/cases/", site);
    append_encoded(text_of(session, "case"), iri, sizeof iri);
    size_t used = strlen(iri);
    snprintf(iri + used, sizeof iri - used, "/%s", text_of(session, "case_hash"));
    return json_pack("{s:s, s:s, s:{s:{s:s}, s:s}}", "objectType", "Activity", "id", iri,
                     "definition", "name", "en", text_of(session, "case"), "type", ACTIVITY_TYPE);
}

// An object with one entry, named by an address of the site's.
static json_t *extension(const char *site, const char *name, json_t *value) {
    char iri[IRI_MAX];
    json_t *extensions = json_object();
    snprintf(iri, sizeof iri, "%s/xapi/%s", site, name);
    json_object_set_new(extensions, iri, value);
    return extensions;
}

static json_t *results_of(const json_t *results, const char *id) {
    json_t *own = json_object_get(results, id);
    return own ? json_incref(own) : json_array();
}

static json_t *outcome(const json_t *session, const json_t *results, const char *site) {
    char duration[32];
    int64_t lasted_ns = number_of(session, "end_utc_ns") - number_of(session, "start_utc_ns");
    snprintf(duration, sizeof duration, "PT%.2fS",
             lasted_ns > 0 ? (double)lasted_ns / (double)NS_PER_S : 0);
    bool closed = !strcmp(text_of(session, "state"), "closed");
    return json_pack("{s:b, s:s, s:o}", "completion", closed, "duration", duration, "extensions",
                     extension(site, "results", results_of(results, text_of(session, "id"))));
}

static json_t *context(const json_t *session, const char *site, const char *uuid) {
    const char *trace = strrchr(text_of(session, "trace"), '/');
    json_t *evidence = json_pack(
        "{s:s, s:s?, s:s?, s:s, s:s, s:O, s:O}", "file",
        trace ? trace + 1 : text_of(session, "trace"), "hash", text_of(session, "trace_hash"),
        "xxh3", text_of(session, "trace_xxh3"), "session", text_of(session, "id"), "station",
        text_of(session, "station"), "steps", json_object_get(session, "steps"), "missing",
        json_object_get(session, "missing"));
    return json_pack("{s:s, s:s, s:o}", "registration", uuid, "platform",
                     "arthron-server " ARTHRON_VERSION, "extensions",
                     extension(site, "trace", evidence));
}

static json_t *statement(const json_t *session, const json_t *results, const char *site) {
    char uuid[37], when[32];
    uuid_of(text_of(session, "id"), uuid);
    rows_time(number_of(session, "end_utc_ns"), when);
    return json_pack("{s:s, s:o, s:o, s:o, s:o, s:o, s:s, s:s}", "id", uuid, "actor",
                     actor(session, site), "verb", verb(session), "object", object(session, site),
                     "result", outcome(session, results, site), "context",
                     context(session, site, uuid), "timestamp", when, "version", "1.0.3");
}

// ---- all of them --------------------------------------------------------------------------------

// { session: [ {metric, ...}, ... ] }
static json_t *by_session(json_t *rows) {
    json_t *grouped = json_object(), *row;
    size_t i;
    json_array_foreach(rows, i, row) {
        const char *id = text_of(row, "session");
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
    return text_of(session, "trainee") && json_is_integer(json_object_get(session, "end_utc_ns"));
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

static enum result check_site(const char *site, struct error *err) {
    bool has_scheme = !strncmp(site, "https://", 8) || !strncmp(site, "http://", 7);
    size_t length = strlen(site);
    bool plain = true;
    for (size_t i = 0; i < length; i++)
        plain = plain && site[i] > 0x20 && site[i] < 0x7f && !strchr("\"<>\\^`{|}", site[i]);
    if (!has_scheme || !plain || length > 256 || site[length - 1] == '/')
        return fail(err, RESULT_INVALID,
                    "--site %.80s: not an address like https://training.example.org/arthron", site);
    return RESULT_OK;
}

enum result xapi_export(struct store *store, const char *path, const char *site, int *out_left,
                        struct error *err) {
    enum result result = check_site(site, err);
    if (result != RESULT_OK)
        return result;
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
