#include "api/attempts.h"

#include "api/curriculum.h"
#include "api/routes.h"
#include "api/tasks.h"
#include "api/values.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/number.h"
#include "curve/learning.h"
#include "curve/quartiles.h"
#include "store/exams.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CURVE_MAX 500
#define UTC_MAX_S 9007199254.0

// ---- as JSON ------------------------------------------------------------------------------------

static json_t *parsed(const json_t *row, const char *field) {
    const char *text = json_string_value(json_object_get(row, field));
    json_t *json = text ? json_loads(text, 0, NULL) : NULL;
    return json ? json : json_null();
}

static void put_null(json_t *row, const char *field) {
    json_object_set_new(row, field, json_null());
}

// What neither the trainee nor its raters see of an exam before it is released.
static void withhold(json_t *row) {
    static const char *const fields[] = {"verdict", "time_s",   "goals_met", "errors",
                                         "end",     "sentinel", NULL};
    for (int i = 0; fields[i]; i++)
        put_null(row, fields[i]);
    json_object_set_new(row, "figures", json_object());
    json_object_set_new(row, "occurrences", json_array());
    json_object_set_new(row, "withheld", json_true());
}

// Of an exam that was not released.
static bool is_attempt_sealed(const json_t *row) {
    const char *purpose = json_string_value(json_object_get(row, "purpose"));
    const char *state = json_string_value(json_object_get(row, "exam_state"));
    return !strcmp(purpose, "exam") && (!state || strcmp(state, "released"));
}

static json_t *attempt_json(const struct api_call *call, const struct store_cell *cells,
                            int count) {
    json_t *row = call_row(cells, count);
    bool withheld = call_is_trainee(call) && is_attempt_sealed(row);
    json_t *sentinel = json_object_get(row, "sentinel");
    json_object_set_new(row, "sentinel", json_boolean(json_integer_value(sentinel)));
    json_object_set_new(row, "pass",
                        json_pack("{s:O, s:O}", "time_s", json_object_get(row, "pass_time_s"),
                                  "errors", json_object_get(row, "pass_errors")));
    json_object_set_new(row, "figures", parsed(row, "figures"));
    json_object_set_new(row, "occurrences", parsed(row, "occurrences"));
    json_object_set_new(row, "withheld", json_boolean(withheld));
    if (withheld)
        withhold(row);
    json_object_del(row, "pass_time_s");
    json_object_del(row, "pass_errors");
    json_object_del(row, "trainee_number");
    return row;
}

struct attempts {
    const struct api_call *call;
    json_t *all;
};

static void take_attempt(void *user, const struct store_cell *cells, int count) {
    struct attempts *attempts = user;
    json_array_append_new(attempts->all, attempt_json(attempts->call, cells, count));
}

const char *attempt_rater(const struct api_call *call) {
    return call->principal.role == ROLE_INSTRUCTOR ? call->principal.name : NULL;
}

bool attempt_is_blind(struct api_call *call, const char *session) {
    struct error err = {""};
    bool blind = false;
    if (!attempt_rater(call))
        return false;
    enum result result = store_is_blind(call->store, attempt_rater(call), session, &blind, &err);
    return !call_check(call, result, &err) || blind;
}

bool attempt_is_withheld(struct api_call *call, const char *session) {
    struct error err = {""};
    bool withheld = false;
    if (!call_is_trainee(call))
        return false;
    enum result result = store_is_withheld(call->store, session, &withheld, &err);
    return !call_check(call, result, &err) || withheld;
}

// Who rates an exam learns neither whose it is, nor what the server says of it. False after a
// refusal.
static bool hide_attempt_names(struct api_call *call, json_t *attempts) {
    size_t i;
    json_t *row;
    json_array_foreach(attempts, i, row) {
        const char *session = json_string_value(json_object_get(row, "session"));
        if (attempt_is_blind(call, session)) {
            if (call->response->status)
                return false;
            put_null(row, "trainee");
            if (is_attempt_sealed(row))
                withhold(row);
        }
        json_object_del(row, "exam_state");
    }
    return true;
}

// Those of the filter, newest first; NULL after a refusal.
static json_t *read_attempts(struct api_call *call, struct attempt_filter filter) {
    struct attempts attempts = {call, json_array()};
    struct error err = {""};
    filter.rater = attempt_rater(call);
    if (call_is_trainee(call)) {
        bool others = filter.trainee && strcmp(filter.trainee, call->principal.trainee);
        filter.trainee = others ? "" : call->principal.trainee; // nobody's
    }
    enum result result = store_attempt_list(call->store, &filter, take_attempt, &attempts, &err);
    if (call_check(call, result, &err) && hide_attempt_names(call, attempts.all))
        return attempts.all;
    json_decref(attempts.all);
    return NULL;
}

// ---- lists --------------------------------------------------------------------------------------

enum { BY_COURSE, BY_TASK, BY_TRAINEE, BY_SESSION, SINCE, UNTIL, BY_PURPOSE, PAGE_BEFORE, AT_MOST };

// "SESSION.NUMBER", as `next` gives it. False after a refusal.
static bool take_before(struct api_call *call, const struct call_query *query,
                        struct attempt_filter *filter, char session[STORE_ID_MAX]) {
    const char *text = call_parameter(query, PAGE_BEFORE);
    int64_t number;
    if (!text)
        return true;
    if (strlen(text) > STORE_ID_MAX && text[STORE_ID_MAX - 1] == '.' &&
        number_int(text + STORE_ID_MAX, 1, INT32_MAX, &number)) {
        snprintf(session, STORE_ID_MAX, "%.*s", STORE_ID_MAX - 1, text);
        filter->before_session = session;
        filter->before_number = (int)number;
        return true;
    }
    call_refuse(call, 400, "wrong_query", "before",
                "The parameter 'before' is what another answer gave as 'next'.");
    return false;
}

static bool take_attempt_times(struct api_call *call, const struct call_query *query,
                               struct attempt_filter *filter) {
    double from_s = 0, to_s = 0;
    if (!value_parameter(call, query, SINCE, 0, UTC_MAX_S, &from_s) ||
        !value_parameter(call, query, UNTIL, 0, UTC_MAX_S, &to_s))
        return false;
    filter->from_utc_ns = (int64_t)(from_s * 1000) * NS_PER_MS;
    filter->to_utc_ns = (int64_t)(to_s * 1000) * NS_PER_MS;
    return true;
}

// The key that the next page starts after, or null: the query reads one row more than the limit.
static json_t *take_next_attempt(json_t *rows, int limit) {
    if (json_array_size(rows) <= (size_t)limit)
        return json_null();
    json_array_remove(rows, (size_t)limit);
    json_t *last = json_array_get(rows, (size_t)limit - 1);
    return json_sprintf("%s.%d", json_string_value(json_object_get(last, "session")),
                        (int)json_integer_value(json_object_get(last, "number")));
}

static void drop_details(json_t *rows) {
    size_t i;
    json_t *row;
    json_array_foreach(rows, i, row) {
        json_object_del(row, "figures");
        json_object_del(row, "occurrences");
    }
}

void get_attempts(struct api_call *call) {
    struct call_query query = {.names = {"course", "task", "trainee", "session", "from", "to",
                                         "purpose", "before", "limit"}};
    char before[STORE_ID_MAX];
    int limit;
    if (!call_take_query(call, &query) || !call_take_limit(call, &query, AT_MOST, 500, 50, &limit))
        return;
    struct attempt_filter filter = {.course = call_parameter(&query, BY_COURSE),
                                    .task = call_parameter(&query, BY_TASK),
                                    .trainee = call_parameter(&query, BY_TRAINEE),
                                    .session = call_parameter(&query, BY_SESSION),
                                    .purpose = call_parameter(&query, BY_PURPOSE),
                                    .limit = limit + 1};
    if (!take_before(call, &query, &filter, before) || !take_attempt_times(call, &query, &filter))
        return;
    json_t *rows = read_attempts(call, filter);
    if (!rows)
        return;
    json_t *next = take_next_attempt(rows, limit);
    drop_details(rows);
    call_answer(call, 200, json_pack("{s:o, s:o}", "attempts", rows, "next", next));
}

// ---- one ----------------------------------------------------------------------------------------

json_t *attempt_of_path(struct api_call *call, int64_t *out_number) {
    if (!value_in_path(call, call->args[1], out_number))
        return NULL;
    const struct attempt_filter filter = {
        .session = call->args[0], .number = (int)*out_number, .limit = 1};
    json_t *rows = read_attempts(call, filter);
    json_t *row = json_incref(json_array_get(rows, 0));
    if (rows && !row)
        call_refuse(call, 404, "not_found", NULL, "There is no such attempt.");
    json_decref(rows);
    return row;
}

void get_attempt(struct api_call *call) {
    int64_t number;
    json_t *row = attempt_of_path(call, &number);
    if (!row)
        return;
    const char *trainee = json_string_value(json_object_get(row, "trainee"));
    if (trainee && strcmp(trainee, call->principal.trainee))
        api_note_reading(call->api, call->principal.actor, call->args[0]);
    json_t *figures = json_incref(json_object_get(row, "figures"));
    json_t *occurrences = json_incref(json_object_get(row, "occurrences"));
    json_object_del(row, "figures");
    json_object_del(row, "occurrences");
    call_answer(call, 200,
                json_pack("{s:o, s:o, s:o}", "attempt", row, "figures", figures, "occurrences",
                          occurrences));
}

// ---- the curve ----------------------------------------------------------------------------------

// Oldest first, with what a curve shows.
static json_t *trials_of(const json_t *rows) {
    static const char *const fields[] = {"session", "number",  "begun_utc_s", "time_s",
                                         "errors",  "verdict", "hand",        "mark_version"};
    json_t *trials = json_array();
    for (size_t i = json_array_size(rows); i-- > 0;) {
        json_t *trial = json_object(), *row = json_array_get(rows, i);
        for (size_t f = 0; f < sizeof fields / sizeof *fields; f++)
            json_object_set(trial, fields[f], json_object_get(row, fields[f]));
        json_array_append_new(trials, trial);
    }
    return trials;
}

static json_t *cusum_json(const struct learning_point *points, int count) {
    const struct learning_rule *rule = &learning_rule_knee;
    json_t *scores = json_array(), *relapses = json_array(), *states = json_array();
    int competent_at = 0;
    for (int i = 0; i < count; i++) {
        bool competent = points[i].state == COMPETENT;
        json_array_append_new(scores, json_real(points[i].score));
        json_array_append_new(states, json_boolean(competent));
        if (points[i].changed && competent && !competent_at)
            competent_at = i + 1;
        if (points[i].changed && !competent)
            json_array_append_new(relapses, json_integer(i + 1));
    }
    return json_pack("{s:f, s:f, s:f, s:f, s:o, s:o, s:o, s:o}", "p0", rule->rejected_rate, "p1",
                     rule->accepted_rate, "h", rule->limit, "relapse", rule->relapse, "scores",
                     scores, "competent", states, "competent_at",
                     competent_at ? json_integer(competent_at) : json_null(), "relapses", relapses);
}

static json_t *cusum_of(const json_t *trials) {
    struct learning_point points[CURVE_MAX];
    bool passed[CURVE_MAX];
    int count = (int)json_array_size(trials);
    for (int i = 0; i < count; i++) {
        const json_t *trial = json_array_get(trials, (size_t)i);
        passed[i] = !strcmp(json_string_value(json_object_get(trial, "verdict")), "passed");
    }
    learning_curve(&learning_rule_knee, passed, count, points);
    return cusum_json(points, count);
}

// The times at one attempt of a course, sorted, which come after each other.
struct bands {
    json_t *all;
    int64_t attempt;
    double *times;
    size_t count, room;
};

static void finish_band(struct bands *b) {
    if (!b->count)
        return;
    int count = (int)b->count;
    json_array_append_new(b->all, json_pack("{s:I, s:i, s:[f, f, f]}", "attempt",
                                            (json_int_t)b->attempt, "trainees", count, "quartiles",
                                            sorted_quantile(b->times, count, 0.25),
                                            sorted_quantile(b->times, count, 0.5),
                                            sorted_quantile(b->times, count, 0.75)));
    b->count = 0;
}

static void take_attempt_time(void *user, const struct store_cell *cells, int count) {
    struct bands *b = user;
    CHECK(count == 5); // as store_figures_on
    if (cells[2].integer != b->attempt)
        finish_band(b);
    b->attempt = cells[2].integer;
    if (b->count == b->room) {
        b->room = 2 * b->room + 64;
        b->times = alloc_resize(b->times, b->room, sizeof *b->times);
    }
    b->times[b->count++] = cells[4].real;
}

// NULL after a refusal.
static json_t *bands_of(struct api_call *call, const char *task, const char *course,
                        const char *hand) {
    struct bands bands = {.all = json_array()};
    struct error err = {""};
    enum result result = RESULT_OK;
    if (course)
        result = store_times_at(call->store, task, course, hand, call_is_trainee(call),
                                take_attempt_time, &bands, &err);
    finish_band(&bands);
    free(bands.times);
    if (call_check(call, result, &err))
        return bands.all;
    json_decref(bands.all);
    return NULL;
}

static void answer_curve(struct api_call *call, const struct task *task,
                         const struct attempt_filter *filter, json_t *bands) {
    struct pass_mark mark;
    json_t *rows = task_mark(call, task, &mark) ? read_attempts(call, *filter) : NULL;
    if (!rows) {
        json_decref(bands);
        return;
    }
    json_t *trials = trials_of(rows);
    json_decref(rows);
    call_answer(call, 200,
                json_pack("{s:s, s:s, s:o, s:o, s:o, s:o}", "task", task->name, "trainee",
                          filter->trainee, "mark", task_mark_json(&mark), "cusum",
                          json_array_size(trials) ? cusum_of(trials) : json_null(), "attempts",
                          trials, "course", bands));
}

void get_curve(struct api_call *call) {
    enum { TASK_NAME, TRAINEE_NAME, COURSE_NAME, HAND };
    struct call_query query = {.names = {"task", "trainee", "course", "hand"}};
    if (!call_take_query(call, &query))
        return;
    const char *trainee = call_parameter(&query, TRAINEE_NAME);
    const char *course = call_parameter(&query, COURSE_NAME), *hand = call_parameter(&query, HAND);
    if (call_is_trainee(call) && !trainee)
        trainee = call->principal.trainee;
    if (!call_parameter(&query, TASK_NAME) || !trainee) {
        const char *field = call_parameter(&query, TASK_NAME) ? "trainee" : "task";
        call_refuse(call, 400, "wrong_query", field, "The parameter '%s' is missing.", field);
        return;
    }
    const struct task *task = task_need(call, call_parameter(&query, TASK_NAME));
    const struct attempt_filter filter = {.task = call_parameter(&query, TASK_NAME),
                                          .trainee = trainee,
                                          .purpose = "practice",
                                          .hand = hand,
                                          .counted = true,
                                          .limit = CURVE_MAX};
    if (!task || (course && !call_may_see(call, course)))
        return;
    json_t *bands = bands_of(call, task->name, course, hand);
    if (bands)
        answer_curve(call, task, &filter, bands);
}
