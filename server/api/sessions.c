#include "api/attempts.h"
#include "api/forward.h"
#include "api/routes.h"
#include "base/check.h"
#include "records/retention.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define VALUES_MAX 200
#define QUANTILES 21

// ---- lists --------------------------------------------------------------------------------------

static void take_session(void *array, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    json_object_del(row, "trace"); // the path concerns only the server
    json_array_append_new(array, row);
}

static bool is_id(const char *text) {
    return strlen(text) == STORE_ID_MAX - 1 && strspn(text, "0123456789abcdef") == strlen(text);
}

// The id that the next page starts after, or null: the query reads one row more than the limit.
static json_t *take_next_session(json_t *rows, int limit) {
    if (json_array_size(rows) <= (size_t)limit)
        return json_null();
    json_array_remove(rows, (size_t)limit);
    return json_incref(json_object_get(json_array_get(rows, (size_t)limit - 1), "id"));
}

// Who rates an exam does not learn whose session it was. False after a refusal.
static bool hide_trainee(struct api_call *call, json_t *row) {
    const char *id = json_string_value(json_object_get(row, "id"));
    if (attempt_is_blind(call, id))
        json_object_set_new(row, "trainee", json_null());
    return !call->response->status;
}

static bool hide_session_names(struct api_call *call, json_t *rows) {
    size_t i;
    json_t *row;
    json_array_foreach(rows, i, row) {
        if (!hide_trainee(call, row))
            return false;
    }
    return true;
}

static void answer_sessions(struct api_call *call, struct store_filter filter) {
    struct error err = {""};
    json_t *rows = json_array();
    int limit = filter.limit++;
    enum result result = store_find_sessions(call->store, &filter, take_session, rows, &err);
    json_t *next = take_next_session(rows, limit);
    json_t *all = json_pack("{s:o, s:o}", "sessions", rows, "next", next);
    if (call_check(call, result, &err) && hide_session_names(call, rows))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

void get_sessions(struct api_call *call) {
    enum { WHOSE, COURSE, CASE, BEFORE, LIMIT };
    struct call_query query = {.names = {"trainee", "course", "case", "before", "limit"}};
    struct store_filter filter;
    int limit;
    if (!call_take_query(call, &query) || !call_take_limit(call, &query, LIMIT, 500, 50, &limit))
        return;
    filter = (struct store_filter){call_parameter(&query, WHOSE),
                                   call_parameter(&query, COURSE),
                                   call_parameter(&query, CASE),
                                   call_parameter(&query, BEFORE),
                                   limit,
                                   attempt_rater(call)};
    if (filter.before && !is_id(filter.before)) {
        call_refuse(call, 400, "wrong_query", "before",
                    "The parameter 'before' is the id of a session.");
        return;
    }
    if (call_is_trainee(call)) {
        bool others = filter.trainee && strcmp(filter.trainee, call->principal.trainee);
        filter.trainee = others ? "" : call->principal.trainee; // nobody's
    }
    answer_sessions(call, filter);
}

void get_audit(struct api_call *call) {
    struct call_query query = {.names = {"limit"}};
    struct error err = {""};
    int limit;
    if (!call_take_query(call, &query) || !call_take_limit(call, &query, 0, 1000, 100, &limit))
        return;
    json_t *rows = json_array();
    enum result result = store_last_audit(call->store, limit, call_take_row, rows, &err);
    call_answer_rows(call, "audit", rows, result, &err);
}

// ---- one ----------------------------------------------------------------------------------------

static bool is_own(const struct api_call *call, const json_t *row) {
    const char *trainee = json_string_value(json_object_get(row, "trainee"));
    return !call_is_trainee(call) ||
           (trainee && trainee[0] && !strcmp(trainee, call->principal.trainee));
}

// The row of the session of the path, with its trace; the caller releases it. NULL after a refusal:
// one that is another's is not there.
static json_t *find_session(struct api_call *call) {
    struct error err = {""};
    json_t *rows = json_array();
    enum result result = RESULT_OK;
    if (is_id(call->args[0]))
        result = store_rows(call->store, LIST_SESSIONS, call->args[0], call_take_row, rows, &err);
    json_t *row = json_incref(json_array_get(rows, 0));
    json_decref(rows);
    if (!call_check(call, result, &err))
        return NULL;
    if (row && is_own(call, row))
        return row;
    json_decref(row);
    call_refuse(call, 404, "not_found", NULL, "There is no such session.");
    return NULL;
}

static void copy_text(const json_t *row, const char *key, char *out, size_t size) {
    const char *text = json_string_value(json_object_get(row, key));
    snprintf(out, size, "%s", text ? text : "");
}

// The part of the session with this number; NULL: there is none. 0: its last one, which the
// session's row tells of.
static json_t *find_part(struct api_call *call, json_t *session, int64_t number) {
    if (!number || number == json_integer_value(json_object_get(session, "part")))
        return json_incref(session);
    json_t *parts = json_array(), *part, *found = NULL;
    size_t i;
    store_rows(call->store, LIST_PARTS, call->args[0], call_take_row, parts, NULL);
    json_array_foreach(parts, i, part) {
        if (json_integer_value(json_object_get(part, "number")) == number)
            found = json_incref(part);
    }
    json_decref(parts);
    return found;
}

void session_server(struct api_call *call, char out_name[STORE_NAME_MAX]) {
    static const char part[] = "part=";
    const char *query = call->request->query;
    bool has_part = !strncmp(query, part, sizeof part - 1);
    json_t *rows = json_array(), *found = NULL;
    if (is_id(call->args[0]))
        store_rows(call->store, LIST_SESSIONS, call->args[0], call_take_row, rows, NULL);
    json_t *row = json_array_get(rows, 0);
    if (row && is_own(call, row))
        found = find_part(call, row, has_part ? atoi(query + sizeof part - 1) : 0);
    copy_text(found, "server", out_name, STORE_NAME_MAX);
    json_decref(found);
    json_decref(rows);
}

// Somebody else's session is being read.
static void note_reading(struct api_call *call, const json_t *row) {
    const char *trainee = json_string_value(json_object_get(row, "trainee"));
    if (trainee && trainee[0] && strcmp(trainee, call->principal.trainee) != 0)
        api_note_reading(call->api, call->principal.actor, call->args[0]);
}

static void take_result(void *array, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    const char *text = json_string_value(json_object_get(row, "details"));
    json_t *details = text ? json_loads(text, 0, NULL) : NULL;
    json_t *below = json_object_get(details, "below_floor");
    json_object_set_new(row, "below_floor", json_boolean(json_is_true(below)));
    json_object_del(row, "details");
    json_object_del(row, "session");
    json_array_append_new(array, row);
    json_decref(details);
}

static void take_trace_part(void *array, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    json_object_del(row, "session");
    json_object_del(row, "trace");
    json_array_append_new(array, row);
}

void get_session(struct api_call *call) {
    struct error err = {""};
    json_t *row = find_session(call);
    if (!row)
        return;
    note_reading(call, row);
    json_object_del(row, "trace");
    json_t *results = json_array(), *parts = json_array();
    enum result result =
        store_rows(call->store, LIST_RESULTS, call->args[0], take_result, results, &err);
    if (result == RESULT_OK)
        result = store_rows(call->store, LIST_PARTS, call->args[0], take_trace_part, parts, &err);
    if (attempt_is_withheld(call, call->args[0]) || attempt_is_blind(call, call->args[0]))
        json_array_clear(results);
    json_t *all = json_pack("{s:o, s:o, s:o}", "session", row, "parts", parts, "results", results);
    if (call_check(call, result, &err) && hide_trainee(call, row))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

void delete_session(struct api_call *call) {
    struct error err = {""};
    json_t *row = find_session(call);
    if (!row)
        return;
    json_decref(row);
    if (call_check(call, store_remove_session(call->store, call->args[0], &err), &err))
        call_done(call);
}

// ---- its trace ----------------------------------------------------------------------------------

// Whether an exam that was not released keeps the trace from the principal, who has been refused.
static bool is_session_sealed(struct api_call *call) {
    bool blind = attempt_is_blind(call, call->args[0]);
    if (!blind && !attempt_is_withheld(call, call->args[0]))
        return false;
    if (!call->response->status)
        call_refuse(call, 403, "not_allowed", NULL,
                    blind ? "You rate an exam of this session, and its trace names the trainee."
                          : "This session has an exam whose result was not released.");
    return true;
}

// The path of its trace, or of an earlier part (0: the last); false after a refusal.
static bool find_trace(struct api_call *call, int part, char out_path[STORE_TEXT_MAX]) {
    struct stat status;
    json_t *row = find_session(call);
    if (!row)
        return false;
    if (is_session_sealed(call)) {
        json_decref(row);
        return false;
    }
    note_reading(call, row);
    json_t *found = find_part(call, row, part);
    copy_text(found, "trace", out_path, STORE_TEXT_MAX);
    json_decref(found);
    json_decref(row);
    if (!stat(out_path, &status) && S_ISREG(status.st_mode)) {
        retention_asked(out_path);
        return true;
    }
    call_refuse(call, 404, "not_found", NULL, "The trace of this session no longer exists.");
    return false;
}

void get_session_trace(struct api_call *call) {
    struct call_query query = {.names = {"part"}};
    struct web_response *r = call->response;
    char path[STORE_TEXT_MAX];
    int part;
    if (!call_take_query(call, &query) || !call_take_limit(call, &query, 0, 10000, 0, &part) ||
        !find_trace(call, part, path))
        return;
    r->status = 200;
    snprintf(r->file, sizeof r->file, "%s", path);
    snprintf(r->owner, sizeof r->owner, "%s", call->principal.actor);
    snprintf(r->type, sizeof r->type, "application/octet-stream");
    if (part)
        snprintf(r->download, sizeof r->download, "%.32s-p%d.trace", call->args[0], part);
    else
        snprintf(r->download, sizeof r->download, "%.32s.trace", call->args[0]);
}

// ---- distributions ------------------------------------------------------------------------------

// Figures are sorted, so those of one metric, subject, version and unit are adjacent.
struct metric_rows {
    json_t *all;
    json_t *head; // of those that are being gathered, or NULL
    double *values;
    size_t count, room;
};

static double quantile(const double *values, size_t count, double share) {
    double at = share * (double)(count - 1);
    size_t below = (size_t)at;
    size_t above = below + 1 < count ? below + 1 : below;
    return values[below] + (at - (double)below) * (values[above] - values[below]);
}

static void tell_rows(struct metric_rows *g) {
    json_t *numbers = json_array();
    bool whole = g->count <= VALUES_MAX;
    for (size_t i = 0; whole && i < g->count; i++)
        json_array_append_new(numbers, json_real(g->values[i]));
    for (int i = 0; !whole && i < QUANTILES; i++)
        json_array_append_new(
            numbers, json_real(quantile(g->values, g->count, (double)i / (QUANTILES - 1))));
    json_object_set_new(g->head, "n", json_integer((json_int_t)g->count));
    json_object_set_new(g->head, whole ? "values" : "quantiles", numbers);
    json_array_append(g->all, g->head);
}

static void finish(struct metric_rows *g) {
    if (g->head)
        tell_rows(g);
    json_decref(g->head);
    g->head = NULL;
    g->count = 0;
}

static void take_figure(void *user, const struct store_cell *cells, int count) {
    struct metric_rows *g = user;
    json_t *head = call_row(cells, count - 1);
    if (!g->head || !json_equal(g->head, head)) {
        finish(g);
        g->head = json_incref(head);
    }
    json_decref(head);
    if (g->count == g->room) {
        g->room = 2 * g->room + 64;
        g->values = alloc_resize(g->values, g->room, sizeof *g->values);
    }
    g->values[g->count++] = cells[count - 1].real;
}

void get_distributions(struct api_call *call) {
    struct call_query query = {.names = {"case", "course"}};
    struct error err = {""};
    if (!call_take_query(call, &query))
        return;
    const char *name = call_parameter(&query, 0), *course = call_parameter(&query, 1);
    if (!name) {
        call_refuse(call, 400, "wrong_query", "case", "The parameter 'case' is missing.");
        return;
    }
    if (!call_may_see(call, course))
        return;
    struct metric_rows g = {.all = json_array()};
    enum result result =
        store_figures_on(call->store, name, course, call_is_trainee(call), take_figure, &g, &err);
    finish(&g);
    free(g.values);
    call_answer_rows(call, "distributions", g.all, result, &err);
}

// ---- its report ---------------------------------------------------------------------------------

static void take_first(void *user, const struct store_cell *cells, int count) {
    char *first = user;
    (void)count;
    if (!first[0])
        snprintf(first, STORE_NAME_MAX, "%s", cells[0].text);
}

// A place among the reports that are being made, one for each account. Staff take the last one that
// is free, which may be theirs alone. NULL: there is none.
static char *take_place(struct api_call *call) {
    struct api *api = call->api;
    const char *actor = call->principal.actor;
    char *place = NULL;
    int places = call_is_trainee(call) ? API_REPORTS_OF_TRAINEES : API_REPORTS_MAX;
    bool waits = false;
    pthread_mutex_lock(&api->reports_lock);
    for (int i = 0; i < API_REPORTS_MAX; i++) {
        waits = waits || !strcmp(api->reporting[i], actor);
        if (i < places && !api->reporting[i][0])
            place = api->reporting[i];
    }
    if (waits)
        place = NULL;
    if (place)
        snprintf(place, STORE_NAME_MAX, "%s", actor);
    pthread_mutex_unlock(&api->reports_lock);
    return place;
}

static void leave_place(struct api *api, char *place) {
    pthread_mutex_lock(&api->reports_lock);
    place[0] = '\0';
    pthread_mutex_unlock(&api->reports_lock);
}

struct report_call {
    const struct api_config *config;
    const struct api_report *about;
};

static enum result write_report(void *user, FILE *file, struct error *err) {
    const struct report_call *report = user;
    return report->config->report(report->config->user, report->about, file, err);
}

static void make_report(struct api_call *call, const struct api_report *about) {
    struct report_call report = {&call->api->config, about};
    struct web_response *r = call->response;
    struct error err = {""};
    enum result result = call_fill(call, write_report, &report, &err);
    if (result == RESULT_MISSING && about->course) {
        call_refuse(call, 404, "not_found", NULL, "There is no course '%s'.", about->course);
        return;
    }
    if (result != RESULT_OK) // a damaged trace is not the caller's fault
        result = RESULT_IO;
    if (!call_check(call, result, &err))
        return;
    r->stands_alone = r->compress = true;
    snprintf(r->type, sizeof r->type, "text/html; charset=utf-8");
}

// Beside whom a session's figures are shown: those of the course that is asked for; else an
// instructor sees them beside all, and a trainee beside those of the first course that they are in.
// False after a refusal.
static bool choose_course(struct api_call *call, struct call_query *query, struct api_report *about,
                          char out_first[STORE_NAME_MAX]) {
    struct error err = {""};
    out_first[0] = '\0';
    if (!call_take_query(call, query))
        return false;
    about->course = call_parameter(query, 0);
    about->records = call->api->config.records;
    if (about->course)
        return call_may_see(call, about->course);
    if (!call_is_trainee(call))
        return true;
    enum result result =
        store_courses_of(call->store, call->principal.trainee, take_first, out_first, &err);
    about->course = out_first;
    if (!out_first[0])
        about->records = about->course = NULL;
    return call_check(call, result, &err);
}

void get_session_report(struct api_call *call) {
    struct call_query query = {.names = {"course"}};
    char path[STORE_TEXT_MAX], first[STORE_NAME_MAX];
    struct api_report about = {.trace = path, .hide_few = call_is_trainee(call)};
    if (!find_trace(call, 0, path) || !choose_course(call, &query, &about, first))
        return;
    call_close_store(call);
    char *place = take_place(call);
    if (!place) {
        call_refuse(call, 503, "busy", NULL, "The server is making other reports, or one for you.");
        call->response->retry_after_s = 2;
        return;
    }
    make_report(call, &about);
    leave_place(call->api, place);
}
