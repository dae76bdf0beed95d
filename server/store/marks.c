#include "base/clock.h"
#include "store/courses.h"
#include "store/database.h"
#include "store/text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void take_mark(void *user, const struct store_cell *cells, int count) {
    struct pass_mark *out = user;
    (void)count;
    out->version = (int)cells[0].integer;
    out->task_version = (int)cells[1].integer;
    snprintf(out->kind, sizeof out->kind, "%s", cells[2].text);
    snprintf(out->source, sizeof out->source, "%s", cells[3].text);
    out->time_s = cells[4].real;
    out->errors = (int)cells[5].integer;
    out->created_utc_ns = cells[6].integer;
}

enum result store_task_mark(struct store *store, const char *task, int task_version,
                            struct pass_mark *out, struct error *err) {
    sqlite3_stmt *statement;
    *out = (struct pass_mark){0};
    enum result result =
        store_prepare(store,
                      "SELECT version, task_version, kind, source, time_s, errors, "
                      "created_utc_ns FROM pass_mark WHERE task = ? AND task_version = ? "
                      "ORDER BY version DESC LIMIT 1",
                      &statement, err, "ti", task, (int64_t)task_version);
    if (result == RESULT_OK)
        result = store_each_row(store, statement, take_mark, out, err);
    if (result == RESULT_OK && !out->version)
        result = fail(err, RESULT_MISSING, "%s: task '%.*s' has no other pass mark than its own",
                      store->path, ATTEMPT_TASK_MAX, task);
    return result;
}

static enum result check_mark(const char *task, const struct pass_mark *mark, struct error *err) {
    static const char *const kinds[] = {"by hand", "contrasting groups", "published"};
    bool known = false;
    enum result result = text_check(task, "task's name", ATTEMPT_TASK_MAX, err);
    if (result == RESULT_OK)
        result = text_check(mark->source, "source of the pass mark", sizeof mark->source, err);
    if (result != RESULT_OK)
        return result;
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        known = known || !strcmp(mark->kind, kinds[i]);
    if (!known)
        return fail(err, RESULT_INVALID,
                    "a pass mark is set by hand, of contrasting groups, or published");
    if (!(mark->time_s >= 1 && mark->time_s <= MARK_TIME_MAX_S))
        return fail(err, RESULT_INVALID, "the time of a pass mark is 1 to %d s", MARK_TIME_MAX_S);
    if (mark->errors < 0 || mark->errors > MARK_ERRORS_MAX)
        return fail(err, RESULT_INVALID, "a pass mark permits 0 to %d errors", MARK_ERRORS_MAX);
    return RESULT_OK;
}

enum result store_add_mark(struct store *store, const char *task, const struct pass_mark *mark,
                           struct error *err) {
    struct pass_mark newest;
    char subject[STORE_NAME_MAX];
    enum result result = check_mark(task, mark, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = store_task_mark(store, task, mark->task_version, &newest, err);
    result = result == RESULT_MISSING ? RESULT_OK : result;
    if (result == RESULT_OK && newest.version != mark->version)
        result = fail(err, RESULT_REFUSED,
                      "%s: the pass mark of task '%s' has version %d, not %d; read it again",
                      store->path, task, newest.version, mark->version);
    if (result == RESULT_OK)
        result =
            store_do(store,
                     "INSERT INTO pass_mark (task, version, task_version, kind, source, "
                     "time_s, errors, created_utc_ns) SELECT ?1, 1 + ifnull(max(version), 0), ?2, "
                     "?3, ?4, ?5, ?6, ?7 FROM pass_mark WHERE task = ?1",
                     err, "tittrii", task, (int64_t)mark->task_version, mark->kind, mark->source,
                     mark->time_s, (int64_t)mark->errors, clock_utc_ns());
    snprintf(subject, sizeof subject, "task %s", task);
    if (result == RESULT_OK)
        result = store_note(store, "pass mark", subject, err);
    return store_end(store, result, err);
}
