#include "api/tasks.h"

#include "api/routes.h"
#include "api/values.h"
#include "base/check.h"
#include "curve/groups.h"
#include "curve/quartiles.h"
#include "store/attempts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TRIALS_MAX 1000
#define BINS 20

// ---- the library --------------------------------------------------------------------------------

const struct task *task_find(const struct api_call *call, const char *name) {
    const struct api_config *config = &call->api->config;
    for (int i = 0; i < config->task_count; i++)
        if (!strcmp(config->tasks[i].name, name))
            return &config->tasks[i];
    return NULL;
}

const struct task *task_need(struct api_call *call, const char *name) {
    const struct task *task = task_find(call, name);
    if (!task)
        call_refuse(call, 404, "not_found", NULL, "The server has no task '%.40s'.", name);
    return task;
}

json_t *task_title(const struct api_call *call, const char *name) {
    const struct task *task = task_find(call, name);
    return task ? call_string(task->title) : json_null();
}

static struct pass_mark mark_of_file(const struct task *task) {
    struct pass_mark mark = {.task_version = task->version,
                             .kind = "task file",
                             .time_s = task->pass_time_s,
                             .errors = task->pass_errors};
    snprintf(mark.source, sizeof mark.source, "%.*s", (int)sizeof mark.source - 1, task->source);
    return mark;
}

bool task_mark(struct api_call *call, const struct task *task, struct pass_mark *out) {
    struct error err = {""};
    enum result result = store_task_mark(call->store, task->name, task->version, out, &err);
    if (result == RESULT_MISSING)
        *out = mark_of_file(task);
    return result == RESULT_MISSING || call_check(call, result, &err);
}

json_t *task_mark_json(const struct pass_mark *mark) {
    bool has_time = mark->created_utc_ns != 0;
    return json_pack("{s:i, s:i, s:s, s:o, s:f, s:i, s:o}", "version", mark->version,
                     "task_version", mark->task_version, "kind", mark->kind, "source",
                     call_string(mark->source), "time_s", mark->time_s, "errors", mark->errors,
                     "created_utc_s",
                     has_time ? json_real(call_seconds(mark->created_utc_ns)) : json_null());
}

static bool has_text(const json_t *texts, const char *text) {
    size_t i;
    json_t *value;
    json_array_foreach((json_t *)texts, i, value) {
        if (!strcmp(json_string_value(value), text))
            return true;
    }
    return false;
}

static void add_tool(json_t *tools, const char *name) {
    if (!has_text(tools, name))
        json_array_append_new(tools, json_string(name));
}

// The instruments that its goals need; the scope, which every task needs, first.
static json_t *tools_of(const struct task *task) {
    json_t *tools = json_array();
    add_tool(tools, "scope");
    for (const struct goal *goal = task->goals; goal < task->goals + task->goal_count; goal++) {
        if (goal->touch[0] || goal->place_count)
            add_tool(tools, goal->tool);
        if (goal->take_out[0])
            add_tool(tools, "grasper");
        if (goal->resect[0]) {
            add_tool(tools, "punch");
            add_tool(tools, "shaver");
        }
    }
    return tools;
}

static void add_limit(json_t *limits, const char *name, double value) {
    if (!isnan(value))
        json_object_set_new(limits, name, json_real(value));
}

static void add_if(json_t *limits, bool is_so, const char *name, double value) {
    if (is_so)
        add_limit(limits, name, value);
}

// What a goal asks beyond its place, by the keys of its file.
static json_t *limits_of_goal(const struct goal *goal) {
    json_t *limits = json_object();
    bool sees = goal->see[0], touches = goal->touch[0] || goal->place_count;
    add_if(limits, goal->hold_s > 0, "hold_s", goal->hold_s);
    add_if(limits, sees && goal->centre < 1, "centre", goal->centre);
    add_if(limits, sees, "within_mm", goal->within_mm);
    add_if(limits, sees && goal->beyond_mm > 0, "beyond_mm", goal->beyond_mm);
    add_limit(limits, "upright_deg", goal->upright_deg);
    add_limit(limits, "still_mm", goal->still_mm);
    add_limit(limits, "stay_mm", goal->stay_mm);
    add_if(limits, touches, "reach_mm", goal->reach_mm);
    add_if(limits, touches && goal->in_view, "in_view", 1);
    add_limit(limits, "valgus_deg", goal->valgus_deg);
    add_limit(limits, "varus_deg", goal->varus_deg);
    add_limit(limits, "drawer_mm", goal->drawer_mm);
    add_limit(limits, "flexion_from_deg", goal->flexion_from_deg);
    add_limit(limits, "flexion_to_deg", goal->flexion_to_deg);
    add_limit(limits, "under_share", goal->under_share);
    add_limit(limits, "over_share", goal->over_share);
    add_limit(limits, "rim_mm", goal->rim_mm);
    add_limit(limits, "step_mm", goal->step_mm);
    return limits;
}

static json_t *limits_of_error(const struct task_error *error) {
    json_t *limits = json_object();
    add_limit(limits, "for_s", error->for_s);
    add_limit(limits, "deep_mm", error->deep_mm);
    add_limit(limits, "near_mm", error->near_mm);
    add_limit(limits, "speed_mm_s", error->speed_mm_s);
    add_limit(limits, "over_share", error->over_share);
    return limits;
}

static json_t *errors_of(const struct task *task) {
    json_t *errors = json_array();
    for (const struct task_error *e = task->errors; e < task->errors + task->error_count; e++)
        json_array_append_new(errors, json_pack("{s:s, s:b, s:o}", "name", e->name, "sentinel",
                                                (int)e->sentinel, "limits", limits_of_error(e)));
    return errors;
}

static json_t *task_json(const struct task *task, const struct pass_mark *mark) {
    json_t *goals = json_array(), *limits = json_array();
    for (const struct goal *goal = task->goals; goal < task->goals + task->goal_count; goal++) {
        json_array_append_new(goals, json_string(goal->name));
        json_array_append_new(limits, limits_of_goal(goal));
    }
    return json_pack("{s:s, s:o, s:o, s:i, s:f, s:b, s:o, s:o, s:o, s:o, s:o}", "name", task->name,
                     "title", call_string(task->title), "briefing", call_string(task->briefing),
                     "version", task->version, "limit_s", task->limit_s, "in_order",
                     (int)task->in_order, "tools", tools_of(task), "goals", goals, "limits", limits,
                     "errors", errors_of(task), "mark", task_mark_json(mark));
}

void get_tasks(struct api_call *call) {
    const struct api_config *config = &call->api->config;
    json_t *tasks = json_array();
    struct pass_mark mark;
    for (int i = 0; i < config->task_count; i++) {
        if (!task_mark(call, &config->tasks[i], &mark)) {
            json_decref(tasks);
            return;
        }
        json_array_append_new(tasks, task_json(&config->tasks[i], &mark));
    }
    call_answer(call, 200, json_pack("{s:o}", "tasks", tasks));
}

void get_task(struct api_call *call) {
    const struct task *task = task_need(call, call->args[0]);
    struct pass_mark mark;
    if (task && task_mark(call, task, &mark))
        call_answer(call, 200, json_pack("{s:o}", "task", task_json(task, &mark)));
}

// ---- its pass mark ------------------------------------------------------------------------------

static void take_mark(void *marks, const struct store_cell *cells, int count) {
    json_t *mark = call_row(cells, count);
    json_object_del(mark, "task");
    json_array_insert_new(marks, 0, mark);
}

void get_mark(struct api_call *call) {
    const struct task *task = task_need(call, call->args[0]);
    struct error err = {""};
    if (!task)
        return;
    struct pass_mark own = mark_of_file(task), mark;
    if (!task_mark(call, task, &mark))
        return;
    json_t *marks = json_array();
    enum result result = store_rows(call->store, LIST_MARKS, task->name, take_mark, marks, &err);
    json_array_append_new(marks, task_mark_json(&own));
    json_t *all = json_pack("{s:o, s:o}", "mark", task_mark_json(&mark), "versions", marks);
    if (call_check(call, result, &err))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

static bool take_new_mark(struct api_call *call, struct pass_mark *out) {
    static const char *const fields[] = {"kind", "source", "time_s", "errors", "version", NULL};
    int64_t errors, version;
    if (!value_take_body(call, fields) ||
        !value_text(call, call->body, "kind", sizeof out->kind, out->kind) ||
        !value_text(call, call->body, "source", sizeof out->source, out->source) ||
        !value_number(call, call->body, "time_s", 1, MARK_TIME_MAX_S, &out->time_s) ||
        !value_int(call, call->body, "errors", 0, MARK_ERRORS_MAX, &errors) ||
        !value_int(call, call->body, "version", 0, INT32_MAX - 1, &version))
        return false;
    out->errors = (int)errors;
    out->version = (int)version;
    return true;
}

void put_mark(struct api_call *call) {
    const struct task *task = task_need(call, call->args[0]);
    struct error err = {""};
    struct pass_mark mark = {.task_version = task ? task->version : 0};
    if (task && take_new_mark(call, &mark) &&
        call_check(call, store_add_mark(call->store, task->name, &mark, &err), &err) &&
        task_mark(call, task, &mark))
        call_answer(call, 200, json_pack("{s:o}", "mark", task_mark_json(&mark)));
}

// ---- what is behind a mark ----------------------------------------------------------------------

// The attempts that a mark is looked at with; times: of those that met all goals, count them.
struct trials {
    json_t *all;
    double pass_time_s;
    double pass_errors;
    int passing, count;
    double times[TRIALS_MAX];
};

static const struct store_cell *cell_of(const struct store_cell *cells, int count,
                                        const char *column) {
    for (int i = 0; i < count; i++)
        if (!strcmp(cells[i].column, column))
            return &cells[i];
    CHECK(!"a column of attempts");
    return NULL;
}

static void take_trial(void *user, const struct store_cell *cells, int count) {
    struct trials *t = user;
    bool whole = !strcmp(cell_of(cells, count, "end")->text, "done");
    double time_s = cell_of(cells, count, "time_s")->real;
    int64_t errors = cell_of(cells, count, "errors")->integer;
    bool sentinel = cell_of(cells, count, "sentinel")->integer;
    if (whole && t->count < TRIALS_MAX)
        t->times[t->count++] = time_s;
    t->passing += whole && time_s <= t->pass_time_s && (double)errors <= t->pass_errors;
    json_array_append_new(t->all, json_pack("{s:o, s:I, s:b}", "time_s",
                                            whole ? json_real(time_s) : json_null(), "errors",
                                            (json_int_t)errors, "sentinel", (int)sentinel));
}

static json_t *bins_of(const struct trials *t) {
    json_t *bins = json_array();
    int counts[BINS] = {0};
    double least = INFINITY, most = -INFINITY;
    for (int i = 0; i < t->count; i++) {
        least = fmin(least, t->times[i]);
        most = fmax(most, t->times[i]);
    }
    double width = fmax((most - least) / BINS, 1);
    for (int i = 0; i < t->count; i++) {
        int bin = (int)((t->times[i] - least) / width);
        counts[bin < BINS ? bin : BINS - 1]++;
    }
    for (int i = 0; i < BINS && t->count; i++)
        json_array_append_new(bins, json_pack("{s:f, s:f, s:i}", "from_s", least + i * width,
                                              "to_s", least + (i + 1) * width, "count", counts[i]));
    return bins;
}

void get_trials(struct api_call *call) {
    enum { TIME, ERRORS, COURSE, HAND };
    struct call_query query = {.names = {"time_s", "errors", "course", "hand"}};
    const struct task *task = task_need(call, call->args[0]);
    struct error err = {""};
    struct pass_mark mark;
    if (!task || !call_take_query(call, &query) || !task_mark(call, task, &mark))
        return;
    struct trials *t = alloc(1, sizeof *t);
    t->pass_time_s = mark.time_s;
    t->pass_errors = mark.errors;
    t->all = json_array();
    const struct attempt_filter filter = {.task = task->name,
                                          .purpose = "practice",
                                          .course = call_parameter(&query, COURSE),
                                          .hand = call_parameter(&query, HAND),
                                          .limit = TRIALS_MAX};
    if (value_parameter(call, &query, TIME, 0, MARK_TIME_MAX_S, &t->pass_time_s) &&
        value_parameter(call, &query, ERRORS, 0, MARK_ERRORS_MAX, &t->pass_errors) &&
        call_check(call, store_attempt_list(call->store, &filter, take_trial, t, &err), &err))
        call_answer(call, 200,
                    json_pack("{s:I, s:i, s:{s:f, s:f}, s:O, s:o}", "attempts",
                              (json_int_t)json_array_size(t->all), "would_pass", t->passing, "mark",
                              "time_s", t->pass_time_s, "errors", t->pass_errors, "trials", t->all,
                              "bins", bins_of(t)));
    json_decref(t->all);
    free(t);
}

// ---- a mark of two groups -----------------------------------------------------------------------

// One figure for each person: the median time of the attempts that met all goals.
struct group {
    json_t *times; // lists, by the trainee's name
    int count;
    double figures[TRIALS_MAX];
};

static void take_task_time(void *user, const struct store_cell *cells, int count) {
    struct group *group = user;
    const char *trainee = cell_of(cells, count, "trainee")->text;
    if (strcmp(cell_of(cells, count, "end")->text, "done") != 0)
        return;
    if (!json_object_get(group->times, trainee))
        json_object_set_new(group->times, trainee, json_array());
    json_array_append_new(json_object_get(group->times, trainee),
                          json_real(cell_of(cells, count, "time_s")->real));
}

// False after a refusal.
static bool read_group(struct api_call *call, const char *task, const char *course,
                       struct group *out) {
    struct error err = {""};
    const struct attempt_filter filter = {
        .task = task, .purpose = "practice", .course = course, .limit = TRIALS_MAX};
    enum result result = store_attempt_list(call->store, &filter, take_task_time, out, &err);
    return call_check(call, result, &err);
}

static double median_of(const json_t *times) {
    double sorted[TRIALS_MAX];
    int count = 0;
    size_t i;
    json_t *time;
    json_array_foreach(times, i, time) {
        double s = json_real_value(time);
        int at = count++;
        for (; at && sorted[at - 1] > s; at--)
            sorted[at] = sorted[at - 1];
        sorted[at] = s;
    }
    return sorted_quantile(sorted, count, 0.5);
}

// Members of both courses are in no group.
static void take_figures(struct group *group, const json_t *others) {
    const char *trainee;
    json_t *times;
    json_object_foreach(group->times, trainee, times) {
        if (!json_object_get(others, trainee))
            group->figures[group->count++] = median_of(times);
    }
}

static json_t *group_json(int count, const struct group_shape *shape) {
    return json_pack("{s:i, s:o, s:o}", "n", count, "mean_s",
                     shape ? json_real(shape->mean) : json_null(), "sd_s",
                     shape ? json_real(shape->sd) : json_null());
}

// Groups that give no mark are told why; it is no fault of the request.
static void answer_contrast(struct api_call *call, const struct group *upper,
                            const struct group *lower) {
    struct contrasting_groups groups;
    struct error err = {""};
    enum result result = contrasting_groups(lower->figures, lower->count, upper->figures,
                                            upper->count, true, &groups, &err);
    bool is = result == RESULT_OK;
    if (!is && result != RESULT_REFUSED) {
        call_check(call, result, &err);
        return;
    }
    call_answer(call, 200,
                json_pack("{s:o, s:o, s:o, s:o, s:o, s:o}", "upper",
                          group_json(upper->count, is ? &groups.experts : NULL), "lower",
                          group_json(lower->count, is ? &groups.novices : NULL), "cut_s",
                          is ? json_real(groups.mark) : json_null(), "upper_fail_share",
                          is ? json_real(groups.false_fail) : json_null(), "lower_pass_share",
                          is ? json_real(groups.false_pass) : json_null(), "reason",
                          is ? json_null() : call_string(err.text)));
}

void get_contrast(struct api_call *call) {
    enum { UPPER, LOWER };
    struct call_query query = {.names = {"upper", "lower"}};
    const struct task *task = task_need(call, call->args[0]);
    if (!task || !call_take_query(call, &query))
        return;
    for (int i = 0; i < 2; i++)
        if (!call_parameter(&query, i)) {
            call_refuse(call, 400, "wrong_query", query.names[i],
                        "The parameter '%s' is missing: the name of a course.", query.names[i]);
            return;
        }
    struct group *groups = alloc(2, sizeof *groups), *upper = &groups[0], *lower = &groups[1];
    upper->times = json_object();
    lower->times = json_object();
    if (read_group(call, task->name, call_parameter(&query, UPPER), upper) &&
        read_group(call, task->name, call_parameter(&query, LOWER), lower)) {
        take_figures(upper, lower->times);
        take_figures(lower, upper->times);
        answer_contrast(call, upper, lower);
    }
    json_decref(upper->times);
    json_decref(lower->times);
    free(groups);
}
