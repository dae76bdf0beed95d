#include "api/curriculum.h"

#include "api/routes.h"
#include "api/tasks.h"
#include "api/values.h"
#include "base/check.h"
#include "base/clock.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UTC_MAX_S 9007199254.0 // as ns an int64_t

// ---- as JSON ------------------------------------------------------------------------------------

static json_t *names_json(const char *names, size_t stride, int count) {
    json_t *list = json_array();
    for (int i = 0; i < count; i++)
        json_array_append_new(list, call_string(names + (size_t)i * stride));
    return list;
}

json_t *curriculum_task_json(const struct api_call *call, const struct curriculum_task *t) {
    return json_pack("{s:s, s:o, s:i, s:i, s:s, s:o, s:o, s:o}", "task", t->task, "title",
                     task_title(call, t->task), "week", t->week, "passes", t->passes, "hands",
                     t->each_hand ? "each" : "one", "due_utc_s",
                     t->due_utc_ns ? json_real(call_seconds(t->due_utc_ns)) : json_null(), "cases",
                     names_json(t->cases[0], sizeof t->cases[0], t->case_count), "after",
                     names_json(t->after[0], sizeof t->after[0], t->after_count));
}

static json_t *curriculum_json(const struct api_call *call, const struct curriculum *c) {
    json_t *tasks = json_array();
    for (int i = 0; i < c->count; i++)
        json_array_append_new(tasks, curriculum_task_json(call, &c->tasks[i]));
    return json_pack("{s:i, s:s, s:f, s:o}", "version", c->version, "state",
                     curriculum_state_name(c->state), "changed_utc_s",
                     call_seconds(c->changed_utc_ns), "tasks", tasks);
}

// ---- reading ------------------------------------------------------------------------------------

struct curriculum *curriculum_read(struct api_call *call, const char *course, bool in_force) {
    struct error err = {""};
    if (!call_may_see(call, course))
        return NULL;
    struct curriculum *c = alloc(1, sizeof *c);
    enum result result = store_read_curriculum(call->store, course, in_force, c, &err);
    if (call_check(call, result, &err))
        return c;
    free(c);
    return NULL;
}

static void answer_both(struct api_call *call, const struct curriculum *in_force,
                        const struct curriculum *newest) {
    bool staff = call->principal.role != ROLE_TRAINEE;
    bool has_draft = staff && newest->version && newest->state == CURRICULUM_DRAFT;
    call_answer(call, 200,
                json_pack("{s:o, s:o, s:i}", "curriculum",
                          in_force->version ? curriculum_json(call, in_force) : json_null(),
                          "draft", has_draft ? curriculum_json(call, newest) : json_null(),
                          "version", staff ? newest->version : in_force->version));
}

void get_curriculum(struct api_call *call) {
    struct curriculum *in_force = curriculum_read(call, call->args[0], true);
    struct curriculum *newest = in_force ? curriculum_read(call, call->args[0], false) : NULL;
    if (newest)
        answer_both(call, in_force, newest);
    free(in_force);
    free(newest);
}

// ---- writing ------------------------------------------------------------------------------------

static bool take_int(struct api_call *call, const json_t *from, const char *field, int most,
                     int usual, int *out) {
    int64_t value = usual;
    bool good = !value_is_given(from, field) || value_int(call, from, field, 1, most, &value);
    *out = (int)value;
    return good;
}

static bool take_task_hands(struct api_call *call, const json_t *from, bool *out_each) {
    char hands[8] = "each";
    if (value_is_given(from, "hands") && !value_text(call, from, "hands", sizeof hands, hands))
        return false;
    *out_each = !strcmp(hands, "each");
    if (*out_each || !strcmp(hands, "one"))
        return true;
    call_refuse(call, 400, "wrong_field", "hands", "The field 'hands' is 'each' or 'one'.");
    return false;
}

static bool take_due(struct api_call *call, const json_t *from, int64_t *out_utc_ns) {
    double due_s = 0;
    if (value_is_given(from, "due_utc_s") &&
        !value_number(call, from, "due_utc_s", 1, UTC_MAX_S, &due_s))
        return false;
    *out_utc_ns = (int64_t)(due_s * 1000) * NS_PER_MS;
    return true;
}

// Without `after` a task comes after the one before it.
static bool take_after(struct api_call *call, const json_t *from,
                       const struct curriculum_task *before, struct curriculum_task *out) {
    if (json_object_get(from, "after"))
        return value_texts(call, from, "after", CURRICULUM_AFTER_MAX, sizeof out->after[0],
                           out->after[0], &out->after_count);
    if (before) {
        memcpy(out->after[0], before->task, sizeof out->after[0]);
        out->after_count = 1;
    }
    return true;
}

static bool take_task(struct api_call *call, const json_t *from,
                      const struct curriculum_task *before, struct curriculum_task *out) {
    static const char *const fields[] = {"task",  "week",  "passes", "hands", "due_utc_s",
                                         "cases", "after", "title",  NULL};
    if (!json_is_object(from)) {
        call_refuse(call, 400, "wrong_field", "tasks",
                    "The field 'tasks' has something that is no object.");
        return false;
    }
    if (!value_has_only(call, from, fields) ||
        !value_text(call, from, "task", sizeof out->task, out->task) ||
        !take_int(call, from, "week", CURRICULUM_WEEK_MAX, 1, &out->week) ||
        !take_int(call, from, "passes", CURRICULUM_PASSES_MAX, 2, &out->passes) ||
        !take_task_hands(call, from, &out->each_hand) || !take_due(call, from, &out->due_utc_ns) ||
        !value_texts(call, from, "cases", CURRICULUM_CASES_MAX, sizeof out->cases[0], out->cases[0],
                     &out->case_count) ||
        !take_after(call, from, before, out))
        return false;
    if (task_find(call, out->task))
        return true;
    call_refuse(call, 400, "wrong_field", "task", "The server has no task '%s'.", out->task);
    return false;
}

static bool take_course_tasks(struct api_call *call, struct curriculum *out) {
    json_t *list = json_object_get(call->body, "tasks");
    size_t count = json_array_size(list);
    if (!json_is_array(list) || !count || count > CURRICULUM_TASKS_MAX) {
        call_refuse(call, 400, "wrong_field", "tasks",
                    "The field 'tasks' is not a list of 1 to %d objects.", CURRICULUM_TASKS_MAX);
        return false;
    }
    for (size_t i = 0; i < count; i++)
        if (!take_task(call, json_array_get(list, i), i ? &out->tasks[i - 1] : NULL,
                       &out->tasks[i]))
            return false;
    out->count = (int)count;
    return true;
}

static bool take_state(struct api_call *call, enum curriculum_state *out) {
    char text[16];
    if (!value_text(call, call->body, "state", sizeof text, text))
        return false;
    for (int i = CURRICULUM_DRAFT; i <= CURRICULUM_FROZEN; i++) {
        *out = (enum curriculum_state)i;
        if (!strcmp(text, curriculum_state_name(*out)))
            return true;
    }
    call_refuse(call, 400, "wrong_field", "state",
                "The field 'state' is 'draft', 'published' or 'frozen'.");
    return false;
}

static bool write_curriculum(struct api_call *call, struct curriculum *c) {
    struct error err = {""};
    const char *course = call->args[0];
    if (c->state == CURRICULUM_FROZEN)
        return call_check(call, store_freeze_curriculum(call->store, course, c->version, &err),
                          &err);
    if (!take_course_tasks(call, c))
        return false;
    enum result result = store_write_curriculum(call->store, course, c->version, c->tasks, c->count,
                                                c->state == CURRICULUM_PUBLISHED, &err);
    return call_check(call, result, &err);
}

void put_curriculum(struct api_call *call) {
    static const char *const fields[] = {"version", "state", "tasks", NULL};
    struct curriculum *c = alloc(1, sizeof *c);
    int64_t version;
    if (value_take_body(call, fields) &&
        value_int(call, call->body, "version", 0, INT32_MAX - 1, &version) &&
        take_state(call, &c->state)) {
        c->version = (int)version;
        if (write_curriculum(call, c))
            get_curriculum(call);
    }
    free(c);
}
