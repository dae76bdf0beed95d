#include "base/check.h"
#include "base/clock.h"
#include "store/courses.h"
#include "store/database.h"
#include "store/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LIST_BYTES 2304 // of cases, of tasks before

_Static_assert(CURRICULUM_CASES_MAX *(2 * STORE_NAME_MAX + 3) < LIST_BYTES, "a list holds cases");
_Static_assert(CURRICULUM_AFTER_MAX *(2 * ATTEMPT_TASK_MAX + 3) < LIST_BYTES, "a list holds tasks");

static const char *const course_state_names[] = {"draft", "published", "frozen"};

const char *curriculum_state_name(enum curriculum_state state) {
    return course_state_names[state];
}

// ---- checking -----------------------------------------------------------------------------------

static int find_task(const struct curriculum_task *tasks, int count, const char *name) {
    for (int i = 0; i < count; i++)
        if (!strcmp(tasks[i].task, name))
            return i;
    return -1;
}

static enum result check_names(const struct curriculum_task *t, struct error *err) {
    enum result result = text_check(t->task, "task's name", sizeof t->task, err);
    for (int i = 0; i < t->case_count && result == RESULT_OK; i++)
        result = text_check(t->cases[i], "case's name", sizeof t->cases[i], err);
    return result;
}

// Those before it come before it, so that no task waits for itself.
static enum result check_task(const struct curriculum_task *tasks, int at, struct error *err) {
    const struct curriculum_task *t = &tasks[at];
    enum result result = check_names(t, err);
    if (result != RESULT_OK)
        return result;
    if (find_task(tasks, at, t->task) >= 0)
        return fail(err, RESULT_INVALID, "task '%s' is there twice", t->task);
    if (t->week < 1 || t->week > CURRICULUM_WEEK_MAX)
        return fail(err, RESULT_INVALID, "the week of task '%s' is not from 1 to %d", t->task,
                    CURRICULUM_WEEK_MAX);
    if (t->passes < 1 || t->passes > CURRICULUM_PASSES_MAX)
        return fail(err, RESULT_INVALID, "the passes of task '%s' are not from 1 to %d", t->task,
                    CURRICULUM_PASSES_MAX);
    for (int i = 0; i < t->after_count; i++)
        if (find_task(tasks, at, t->after[i]) < 0)
            return fail(err, RESULT_INVALID,
                        "task '%s' has to come after '%s', which is not before it", t->task,
                        t->after[i]);
    return RESULT_OK;
}

static enum result check_tasks(const struct curriculum_task *tasks, int count, struct error *err) {
    if (count < 1 || count > CURRICULUM_TASKS_MAX)
        return fail(err, RESULT_INVALID, "a curriculum has 1 to %d tasks", CURRICULUM_TASKS_MAX);
    enum result result = RESULT_OK;
    for (int i = 0; i < count && result == RESULT_OK; i++)
        result = check_task(tasks, i, err);
    return result;
}

// ---- lists of names as JSON ---------------------------------------------------------------------

static void put_quoted(char *out, size_t *used, const char *text) {
    out[(*used)++] = '"';
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            out[(*used)++] = '\\';
        out[(*used)++] = *text;
    }
    out[(*used)++] = '"';
}

// Of names that text_check has passed.
static void write_list(const char *names, size_t stride, int count, char out[LIST_BYTES]) {
    size_t used = 0;
    out[used++] = '[';
    for (int i = 0; i < count; i++) {
        if (i)
            out[used++] = ',';
        put_quoted(out, &used, names + (size_t)i * stride);
    }
    out[used++] = ']';
    out[used] = '\0';
}

struct names {
    char *names;
    size_t stride;
    int count, room;
};

static void take_name(void *user, const struct store_cell *cells, int count) {
    struct names *n = user;
    (void)count;
    if (n->count < n->room && cells[0].kind == STORE_TEXT)
        snprintf(n->names + (size_t)n->count++ * n->stride, n->stride, "%s", cells[0].text);
}

static enum result read_list(struct store *store, const char *json, struct names *names,
                             struct error *err) {
    sqlite3_stmt *statement;
    enum result result =
        store_prepare(store, "SELECT value FROM json_each(?)", &statement, err, "t", json);
    return result == RESULT_OK ? store_each_row(store, statement, take_name, names, err) : result;
}

// ---- reading ------------------------------------------------------------------------------------

struct reading {
    struct curriculum *out;
    char cases[CURRICULUM_TASKS_MAX][LIST_BYTES], after[CURRICULUM_TASKS_MAX][LIST_BYTES];
};

enum { TASK, WEEK, PASSES, HANDS, DUE, CASES, AFTER };

static void take_task(void *user, const struct store_cell *cells, int count) {
    struct reading *r = user;
    struct curriculum *out = r->out;
    (void)count;
    if (out->count == CURRICULUM_TASKS_MAX)
        return;
    struct curriculum_task *t = &out->tasks[out->count];
    snprintf(t->task, sizeof t->task, "%s", cells[TASK].text);
    t->week = (int)cells[WEEK].integer;
    t->passes = (int)cells[PASSES].integer;
    t->each_hand = !strcmp(cells[HANDS].text, "each");
    t->due_utc_ns = cells[DUE].kind == STORE_INTEGER ? cells[DUE].integer : 0;
    snprintf(r->cases[out->count], LIST_BYTES, "%s", cells[CASES].text);
    snprintf(r->after[out->count], LIST_BYTES, "%s", cells[AFTER].text);
    out->count++;
}

static enum result read_lists(struct store *store, const struct reading *r, int at,
                              struct error *err) {
    struct curriculum_task *t = &r->out->tasks[at];
    struct names cases = {t->cases[0], sizeof t->cases[0], 0, CURRICULUM_CASES_MAX};
    struct names after = {t->after[0], sizeof t->after[0], 0, CURRICULUM_AFTER_MAX};
    enum result result = read_list(store, r->cases[at], &cases, err);
    if (result == RESULT_OK)
        result = read_list(store, r->after[at], &after, err);
    t->case_count = cases.count;
    t->after_count = after.count;
    return result;
}

static enum result read_tasks(struct store *store, int64_t id, struct curriculum *out,
                              struct error *err) {
    sqlite3_stmt *statement;
    struct reading *reading = alloc(1, sizeof *reading);
    reading->out = out;
    enum result result = store_prepare(store,
                                       "SELECT task, week, passes, hands, due_utc_ns, cases, after "
                                       "FROM curriculum_task WHERE curriculum_id = ? "
                                       "ORDER BY position",
                                       &statement, err, "i", id);
    if (result == RESULT_OK)
        result = store_each_row(store, statement, take_task, reading, err);
    for (int i = 0; i < out->count && result == RESULT_OK; i++)
        result = read_lists(store, reading, i, err);
    free(reading);
    return result;
}

struct head {
    int64_t id;
    struct curriculum *out;
};

static void take_head(void *user, const struct store_cell *cells, int count) {
    struct head *head = user;
    (void)count;
    head->id = cells[0].integer;
    head->out->version = (int)cells[1].integer;
    head->out->changed_utc_ns = cells[3].integer;
    for (int i = 0; i < 3; i++)
        if (!strcmp(cells[2].text, course_state_names[i]))
            head->out->state = (enum curriculum_state)i;
}

// The newest version, or the newest in force; without its tasks.
static enum result read_course_head(struct store *store, int64_t course_id, bool in_force,
                                    struct head *head, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(store,
                                       "SELECT id, version, state, changed_utc_ns FROM curriculum "
                                       "WHERE course_id = ? AND (? = 0 OR state <> 'draft') "
                                       "ORDER BY version DESC LIMIT 1",
                                       &statement, err, "ii", course_id, (int64_t)in_force);
    return result == RESULT_OK ? store_each_row(store, statement, take_head, head, err) : result;
}

enum result store_read_curriculum(struct store *store, const char *course, bool in_force,
                                  struct curriculum *out, struct error *err) {
    int64_t course_id;
    struct head head = {.out = out};
    *out = (struct curriculum){0};
    enum result result = store_run(store, "BEGIN", err); // all of one moment
    if (result != RESULT_OK)
        return result;
    result = store_find_named(store, &course_table, course, &course_id, err);
    if (result == RESULT_OK)
        result = read_course_head(store, course_id, in_force, &head, err);
    if (result == RESULT_OK && out->version)
        result = read_tasks(store, head.id, out, err);
    return store_end(store, result, err);
}

// ---- writing ------------------------------------------------------------------------------------

// Begins a transaction in which `version` is the newest of the course and it is not frozen.
static enum result begin_course_change(struct store *store, const char *course, int version,
                                       int64_t *out_course_id, struct curriculum *out_newest,
                                       struct error *err) {
    struct head head = {.out = out_newest};
    enum result result = store_begin_named(store, &course_table, course, out_course_id, err);
    if (result != RESULT_OK)
        return result;
    result = read_course_head(store, *out_course_id, false, &head, err);
    if (result == RESULT_OK && out_newest->version != version)
        result = fail(err, RESULT_REFUSED,
                      "%s: the curriculum of course '%s' has version %d, not %d; read it again",
                      store->path, course, out_newest->version, version);
    if (result == RESULT_OK && out_newest->state == CURRICULUM_FROZEN)
        result = fail(err, RESULT_REFUSED, "%s: the curriculum of course '%s' is frozen",
                      store->path, course);
    return result == RESULT_OK ? result : store_end(store, result, err);
}

static enum result put_course_task(struct store *store, int64_t course_id, int version, int at,
                                   const struct curriculum_task *t, struct error *err) {
    char cases[LIST_BYTES], after[LIST_BYTES];
    write_list(t->cases[0], sizeof t->cases[0], t->case_count, cases);
    write_list(t->after[0], sizeof t->after[0], t->after_count, after);
    return store_do(store,
                    "INSERT INTO curriculum_task (curriculum_id, position, task, week, passes, "
                    "hands, due_utc_ns, cases, after) VALUES ((SELECT id FROM curriculum WHERE "
                    "course_id = ? AND version = ?), ?, ?, ?, ?, ?, nullif(?, 0), ?, ?)",
                    err, "iiitiititt", course_id, (int64_t)version, (int64_t)at, t->task,
                    (int64_t)t->week, (int64_t)t->passes, t->each_hand ? "each" : "one",
                    t->due_utc_ns, cases, after);
}

static enum result remove_draft(struct store *store, int64_t course_id, struct error *err) {
    return store_do(store, "DELETE FROM curriculum WHERE course_id = ? AND state = 'draft'", err,
                    "i", course_id);
}

static enum result put_curriculum(struct store *store, int64_t course_id, int version, bool publish,
                                  const struct curriculum_task *tasks, int count,
                                  struct error *err) {
    const char *state = course_state_names[publish ? CURRICULUM_PUBLISHED : CURRICULUM_DRAFT];
    enum result result = remove_draft(store, course_id, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT INTO curriculum (id, course_id, version, state, changed_utc_ns) "
                          "VALUES (" STORE_NEXT("curriculum") ", ?, ?, ?, ?)",
                          err, "iiti", course_id, (int64_t)version, state, clock_utc_ns());
    for (int i = 0; i < count && result == RESULT_OK; i++)
        result = put_course_task(store, course_id, version, i, &tasks[i], err);
    return result == RESULT_OK
               ? store_audit(store, publish ? "publish" : "draft", "course", course_id, err)
               : result;
}

enum result store_write_curriculum(struct store *store, const char *course, int version,
                                   const struct curriculum_task *tasks, int count, bool publish,
                                   struct error *err) {
    int64_t course_id;
    struct curriculum *newest = alloc(1, sizeof *newest);
    enum result result = check_tasks(tasks, count, err);
    if (result == RESULT_OK)
        result = begin_course_change(store, course, version, &course_id, newest, err);
    bool is_draft = newest->version && newest->state == CURRICULUM_DRAFT;
    free(newest);
    if (result != RESULT_OK)
        return result;
    result = put_curriculum(store, course_id, is_draft ? version : version + 1, publish, tasks,
                            count, err);
    return store_end(store, result, err);
}

enum result store_freeze_curriculum(struct store *store, const char *course, int version,
                                    struct error *err) {
    int64_t course_id;
    struct curriculum *newest = alloc(1, sizeof *newest);
    enum result result = begin_course_change(store, course, version, &course_id, newest, err);
    free(newest);
    if (result != RESULT_OK)
        return result;
    result = remove_draft(store, course_id, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "UPDATE curriculum SET state = 'frozen' WHERE course_id = ?1 AND "
                          "version = (SELECT max(version) FROM curriculum WHERE course_id = ?1)",
                          err, "i", course_id);
    if (result == RESULT_OK && !sqlite3_changes(store->db))
        result = fail(err, RESULT_REFUSED, "%s: no curriculum of course '%s' was published",
                      store->path, course);
    if (result == RESULT_OK)
        result = store_audit(store, "freeze", "course", course_id, err);
    return store_end(store, result, err);
}

// ---- what trainees have done of it --------------------------------------------------------------

enum result store_practice_in(struct store *store, const char *course, const char *trainee,
                              store_row_handler take, void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT t.name AS trainee, a.task, c.name AS \"case\", a.hand, a.verdict, a.time_s, "
        "a.begun_utc_ns FROM attempt a JOIN session s ON s.id = a.session_id "
        "JOIN knee_case c ON c.id = s.case_id JOIN trainee t ON t.id = s.trainee_id "
        "JOIN enrolment e ON e.trainee_id = t.id WHERE a.purpose = 'practice' "
        "AND " STORE_ATTEMPT_COUNTS " AND e.course_id = (SELECT id FROM course WHERE name = ?1) "
        "AND (?2 IS NULL OR t.name = ?2) "
        "ORDER BY t.name, a.begun_utc_ns, a.id",
        &statement, err, "tt", course, trainee);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}
