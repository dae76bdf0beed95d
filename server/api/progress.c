// How far the trainees of a course are, and what a trainee does next.
#include "api/attempts.h"
#include "api/curriculum.h"
#include "api/gate.h"
#include "api/routes.h"
#include "api/tasks.h"
#include "base/check.h"
#include "base/clock.h"
#include "store/exams.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- the gates of a course ----------------------------------------------------------------------

struct person {
    char name[STORE_NAME_MAX];
    json_t *full_name;
    struct gate gates[CURRICULUM_TASKS_MAX];
    char exams[CURRICULUM_TASKS_MAX][12]; // state of the newest exam with the task; empty: none
};

struct standing {
    const struct curriculum *curriculum;
    struct person *people;
    size_t count, room;
    size_t last; // rows come person by person
};

static void take_person(void *user, const struct store_cell *cells, int count) {
    struct standing *s = user;
    (void)count;
    if (s->count == s->room) {
        s->room = 2 * s->room + 8;
        s->people = alloc_resize(s->people, s->room, sizeof *s->people);
    }
    struct person *person = &s->people[s->count++];
    *person = (struct person){0};
    snprintf(person->name, sizeof person->name, "%s", cells[0].text);
    person->full_name = cells[1].kind == STORE_TEXT ? call_string(cells[1].text) : json_null();
}

static struct person *find_person(struct standing *s, const char *name) {
    for (size_t i = 0; i < s->count; i++) {
        size_t at = (s->last + i) % s->count;
        if (!strcmp(s->people[at].name, name)) {
            s->last = at;
            return &s->people[at];
        }
    }
    return NULL;
}

static int find_task(const struct curriculum *c, const char *task) {
    for (int i = 0; i < c->count; i++)
        if (!strcmp(c->tasks[i].task, task))
            return i;
    return -1;
}

static void take_practice(void *user, const struct store_cell *cells, int count) {
    struct standing *s = user;
    struct person *person = find_person(s, cells[0].text);
    int task = find_task(s->curriculum, cells[1].text);
    (void)count;
    if (person && task >= 0)
        gate_add(&person->gates[task], &s->curriculum->tasks[task], cells[2].text, cells[3].text,
                 !strcmp(cells[4].text, "passed"),
                 gate_is_locked(person->gates, s->curriculum, task), cells[5].real);
}

static void take_exam(void *user, const struct store_cell *cells, int count) {
    struct standing *s = user;
    struct person *person = find_person(s, cells[0].text);
    int task = find_task(s->curriculum, cells[1].text);
    (void)count;
    if (person && task >= 0)
        snprintf(person->exams[task], sizeof person->exams[task], "%s", cells[2].text);
}

// trainee: the only one, or NULL for all.
static void keep_only(struct standing *s, const char *trainee) {
    size_t kept = 0;
    for (size_t i = 0; i < s->count; i++)
        if (!trainee || !strcmp(s->people[i].name, trainee))
            s->people[kept++] = s->people[i];
        else
            json_decref(s->people[i].full_name);
    s->count = kept;
}

// False after a refusal. Released with standing_fini either way.
static bool read_standing(struct api_call *call, const char *course, struct standing *s) {
    struct error err = {""};
    const char *only = call->principal.role == ROLE_TRAINEE ? call->principal.trainee : NULL;
    enum result result = store_trainees_in(call->store, course, take_person, s, &err);
    keep_only(s, only);
    if (result == RESULT_OK)
        result = store_practice_in(call->store, course, only, take_practice, s, &err);
    if (result == RESULT_OK)
        result = store_exams_in(call->store, course, attempt_rater(call), take_exam, s, &err);
    return call_check(call, result, &err);
}

static void standing_fini(struct standing *s) {
    for (size_t i = 0; i < s->count; i++)
        json_decref(s->people[i].full_name);
    free(s->people);
}

static bool is_overdue(const struct standing *s, const struct person *person, int task) {
    const struct curriculum_task *t = &s->curriculum->tasks[task];
    return t->due_utc_ns && t->due_utc_ns < clock_utc_ns() &&
           !gate_is_passed(&person->gates[task], t);
}

static bool is_behind(const struct standing *s, const struct person *person) {
    for (int i = 0; i < s->curriculum->count; i++)
        if (is_overdue(s, person, i))
            return true;
    return false;
}

// ---- all trainees by all tasks ------------------------------------------------------------------

static void set_hand(json_t *out, const char *name, const struct gate *gate,
                     const struct curriculum_task *task, int hand) {
    json_object_set_new(out, name,
                        json_pack("{s:i, s:b}", "in_row", gate->in_row[hand], "passed",
                                  (int)gate_hand_is_passed(gate, task, hand)));
}

static void set_hands(json_t *out, const struct gate *gate, const struct curriculum_task *task) {
    if (!task->each_hand) {
        set_hand(out, "either", gate, task, GATE_RIGHT);
        return;
    }
    set_hand(out, "right", gate, task, GATE_RIGHT);
    set_hand(out, "left", gate, task, GATE_LEFT);
}

static json_t *cell_json(const struct standing *s, const struct person *person, int at) {
    const struct curriculum_task *task = &s->curriculum->tasks[at];
    const struct gate *gate = &person->gates[at];
    const char *exam = person->exams[at];
    json_t *cell = json_pack("{s:s, s:b, s:b, s:i, s:o, s:o}", "state",
                             gate_is_passed(gate, task) ? "passed"
                             : gate->attempts           ? "trying"
                                                        : "empty",
                             "locked", (int)gate_is_locked(person->gates, s->curriculum, at),
                             "overdue", (int)is_overdue(s, person, at), "attempts", gate->attempts,
                             "best_s", gate->best_s > 0 ? json_real(gate->best_s) : json_null(),
                             "exam", exam[0] ? json_string(exam) : json_null());
    set_hands(cell, gate, task);
    return cell;
}

static json_t *person_json(const struct standing *s, const struct person *person) {
    json_t *cells = json_array();
    for (int i = 0; i < s->curriculum->count; i++)
        json_array_append_new(cells, cell_json(s, person, i));
    return json_pack("{s:o, s:O, s:b, s:o}", "name", call_string(person->name), "full_name",
                     person->full_name, "behind", (int)is_behind(s, person), "cells", cells);
}

static json_t *columns_json(const struct api_call *call, const struct curriculum *c) {
    json_t *tasks = json_array();
    for (int i = 0; i < c->count; i++)
        json_array_append_new(tasks, curriculum_task_json(call, &c->tasks[i]));
    return tasks;
}

static void answer_progress(struct api_call *call, const struct standing *s) {
    json_t *people = json_array();
    int behind = 0;
    for (size_t i = 0; i < s->count; i++) {
        json_array_append_new(people, person_json(s, &s->people[i]));
        behind += is_behind(s, &s->people[i]);
    }
    call_answer(call, 200,
                json_pack("{s:i, s:i, s:o, s:o}", "version", s->curriculum->version, "behind",
                          behind, "tasks", columns_json(call, s->curriculum), "trainees", people));
}

void get_progress(struct api_call *call) {
    struct curriculum *c = curriculum_read(call, call->args[0], true);
    struct standing s = {.curriculum = c};
    if (!c)
        return;
    if (read_standing(call, call->args[0], &s))
        answer_progress(call, &s);
    standing_fini(&s);
    free(c);
}

// ---- a trainee's day ----------------------------------------------------------------------------

static json_t *next_json(const struct api_call *call, const struct standing *s, int at) {
    const struct person *person = &s->people[0];
    const struct curriculum_task *task = &s->curriculum->tasks[at];
    const struct gate *gate = &person->gates[at];
    int hand = gate_next_hand(gate, task);
    json_t *out = curriculum_task_json(call, task);
    bool locked = gate_is_locked(person->gates, s->curriculum, at);
    json_object_set_new(out, "state",
                        json_string(gate_is_passed(gate, task) ? "passed"
                                    : locked                   ? "locked"
                                                               : "open"));
    json_object_set_new(out, "overdue", json_boolean(is_overdue(s, person, at)));
    json_object_set_new(out, "hand",
                        json_string(!task->each_hand    ? "either"
                                    : hand == GATE_LEFT ? "left"
                                                        : "right"));
    json_object_set_new(out, "passes_done", json_integer(gate->in_row[hand]));
    json_object_set_new(out, "attempts", json_integer(gate->attempts));
    set_hands(out, gate, task);
    return out;
}

static json_t *day_json(const struct api_call *call, const char *course, const struct standing *s) {
    const struct curriculum *c = s->curriculum;
    const struct gate *gates = s->people[0].gates;
    json_t *steps = json_array(), *next = NULL;
    int passed = 0;
    for (int i = 0; i < c->count; i++) {
        bool is_passed = gate_is_passed(&gates[i], &c->tasks[i]);
        json_array_append_new(steps, next_json(call, s, i));
        passed += is_passed;
        if (!next && !is_passed && !gate_is_locked(gates, c, i))
            next = json_array_get(steps, (size_t)i);
    }
    return json_pack("{s:s, s:i, s:O, s:i, s:i, s:b, s:o}", "course", course, "version", c->version,
                     "next", next ? next : json_null(), "passed", passed, "tasks", c->count,
                     "behind", (int)is_behind(s, &s->people[0]), "steps", steps);
}

// False after a refusal. A course without a curriculum is left out.
static bool add_day(struct api_call *call, const char *course, json_t *days) {
    struct curriculum *c = curriculum_read(call, course, true);
    struct standing s = {.curriculum = c};
    bool good = c && (!c->version || read_standing(call, course, &s));
    if (good && c->version && s.count)
        json_array_append_new(days, day_json(call, course, &s));
    standing_fini(&s);
    free(c);
    return good;
}

static void take_name(void *names, const struct store_cell *cells, int count) {
    (void)count;
    json_array_append_new(names, call_string(cells[0].text));
}

static void take_my_exam(void *exams, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    const char *state = json_string_value(json_object_get(row, "state"));
    if (!strcmp(state, "planned") || !strcmp(state, "begun"))
        json_array_append_new(
            exams, json_pack("{s:O, s:O, s:O, s:O}", "id", json_object_get(row, "id"), "course",
                             json_object_get(row, "course"), "title", json_object_get(row, "title"),
                             "state", json_object_get(row, "state")));
    json_decref(row);
}

void get_today(struct api_call *call) {
    struct error err = {""};
    json_t *names = json_array(), *days = json_array(), *exams = json_array();
    const char *trainee = call->principal.trainee;
    enum result result = store_courses_of(call->store, trainee, take_name, names, &err);
    if (result == RESULT_OK)
        result = store_find_exams(call->store, NULL, trainee, NULL, take_my_exam, exams, &err);
    bool good = call_check(call, result, &err);
    for (size_t i = 0; good && i < json_array_size(names); i++)
        good = add_day(call, json_string_value(json_array_get(names, i)), days);
    if (good)
        call_answer(call, 200, json_pack("{s:O, s:O}", "courses", days, "exams", exams));
    json_decref(names);
    json_decref(days);
    json_decref(exams);
}
