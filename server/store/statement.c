// Statements: prepared once for each connection, bound, run, and ended as a transaction.
#include "base/check.h"
#include "store/change.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

enum result store_run(struct store *store, const char *sql, struct error *err) {
    int code = sqlite3_exec(store->db, sql, NULL, NULL, NULL);
    return code == SQLITE_OK ? RESULT_OK : store_failed(store, code, err);
}

static enum result get_statement(struct store *store, const char *sql, sqlite3_stmt **out,
                                 struct error *err) {
    for (int i = 0; i < store->statement_count; i++)
        if (store->statements[i].sql == sql) {
            *out = store->statements[i].prepared;
            return RESULT_OK;
        }
    CHECK(store->statement_count < STORE_STATEMENTS_MAX);
    int code = sqlite3_prepare_v2(store->db, sql, -1, out, NULL);
    if (code != SQLITE_OK)
        return store_failed(store, code, err);
    store->statements[store->statement_count++] = (struct statement){sql, *out};
    return RESULT_OK;
}

static int bind(sqlite3_stmt *statement, int at, char kind, va_list *args) {
    if (kind == 'i')
        return sqlite3_bind_int64(statement, at, va_arg(*args, int64_t));
    if (kind == 't')
        return sqlite3_bind_text(statement, at, va_arg(*args, const char *), -1, SQLITE_TRANSIENT);
    CHECK(kind == 'r');
    double value = va_arg(*args, double);
    return isfinite(value) ? sqlite3_bind_double(statement, at, value)
                           : sqlite3_bind_null(statement, at);
}

static enum result prepare(struct store *store, const char *sql, sqlite3_stmt **out,
                           struct error *err, const char *kinds, va_list *args) {
    enum result result = get_statement(store, sql, out, err);
    int code = SQLITE_OK;
    for (int i = 0; result == RESULT_OK && kinds[i] && code == SQLITE_OK; i++)
        code = bind(*out, i + 1, kinds[i], args);
    return code == SQLITE_OK ? result : store_failed(store, code, err);
}

enum result store_prepare(struct store *store, const char *sql, sqlite3_stmt **out,
                          struct error *err, const char *kinds, ...) {
    va_list args;
    va_start(args, kinds);
    enum result result = prepare(store, sql, out, err, kinds, &args);
    va_end(args);
    return result;
}

// If out is not NULL, *out becomes the number in the first row.
static enum result run_once(struct store *store, sqlite3_stmt *statement, int64_t *out,
                            struct error *err) {
    int code = sqlite3_step(statement);
    enum result result = RESULT_OK;
    if (code == SQLITE_ROW && out)
        *out = sqlite3_column_int64(statement, 0);
    else if (code == SQLITE_DONE && out)
        result = RESULT_MISSING;
    else if (code != SQLITE_DONE && code != SQLITE_ROW)
        result = store_failed(store, code, err);
    sqlite3_reset(statement);
    sqlite3_clear_bindings(statement);
    return result;
}

enum result store_do(struct store *store, const char *sql, struct error *err, const char *kinds,
                     ...) {
    va_list args;
    sqlite3_stmt *statement;
    va_start(args, kinds);
    enum result result = prepare(store, sql, &statement, err, kinds, &args);
    va_end(args);
    if (result != RESULT_OK)
        return result;
    if (!sqlite3_get_autocommit(store->db) || sqlite3_stmt_readonly(statement))
        return run_once(store, statement, NULL, err);
    result = store_begin(store, err);
    if (result == RESULT_OK)
        result = store_end(store, run_once(store, statement, NULL, err), err);
    else
        sqlite3_clear_bindings(statement);
    return result;
}

enum result store_find(struct store *store, const char *sql, int64_t *out, struct error *err,
                       const char *kinds, ...) {
    va_list args;
    sqlite3_stmt *statement;
    va_start(args, kinds);
    enum result result = prepare(store, sql, &statement, err, kinds, &args);
    va_end(args);
    return result == RESULT_OK ? run_once(store, statement, out, err) : result;
}

enum result store_begin(struct store *store, struct error *err) {
    int64_t shared;
    enum result result = store_run(store, "BEGIN IMMEDIATE", err);
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT server <> '' FROM share", &shared, err, "");
    store->erases = false;
    if (result == RESULT_OK && shared && !(store->changes = change_begin(store->db)))
        result = store_failed(store, SQLITE_NOMEM, err);
    return result == RESULT_OK ? result : store_end(store, result, err);
}

const struct named_table account_table = {"account", "an account",
                                          "SELECT id FROM account WHERE name = ?",
                                          "UPDATE account SET name = ? WHERE id = ?"};
const struct named_table course_table = {"course", "a course",
                                         "SELECT id FROM course WHERE name = ?",
                                         "UPDATE course SET name = ? WHERE id = ?"};
const struct named_table trainee_table = {"trainee", "a trainee",
                                          "SELECT id FROM trainee WHERE name = ?",
                                          "UPDATE trainee SET name = ? WHERE id = ?"};
const struct named_table present_trainee_table = {
    "trainee", "a trainee", "SELECT id FROM trainee WHERE name = ? AND erased_utc_ns IS NULL",
    NULL};

enum result store_find_named(struct store *store, const struct named_table *table, const char *name,
                             int64_t *out_id, struct error *err) {
    enum result result = store_find(store, table->find, out_id, err, "t", name);
    if (result == RESULT_MISSING)
        fail(err, result, "%s: there is no %s '%.*s'", store->path, table->name, STORE_NAME_MAX,
             name);
    return result;
}

enum result store_begin_named(struct store *store, const struct named_table *table,
                              const char *name, int64_t *out_id, struct error *err) {
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = store_find_named(store, table, name, out_id, err);
    return result == RESULT_OK ? result : store_end(store, result, err);
}

enum result store_must_be_new(struct store *store, const struct named_table *table,
                              const char *name, struct error *err) {
    int64_t id;
    enum result result = store_find(store, table->find, &id, err, "t", name);
    if (result == RESULT_OK)
        return fail(err, RESULT_REFUSED, "%s: there is already %s '%s'", store->path,
                    table->with_article, name);
    return result == RESULT_MISSING ? RESULT_OK : result;
}

enum result store_rename_row(struct store *store, const struct named_table *table, int64_t id,
                             const char *new_name, struct error *err) {
    enum result result = store_must_be_new(store, table, new_name, err);
    if (result == RESULT_OK)
        result = store_do(store, table->rename, err, "ti", new_name, id);
    return result == RESULT_OK ? store_audit(store, "rename", table->name, id, err) : result;
}

enum result store_end_added(struct store *store, enum result result, const char *kind,
                            struct error *err) {
    if (result == RESULT_OK)
        result = store_audit(store, "add", kind, sqlite3_last_insert_rowid(store->db), err);
    return store_end(store, result, err);
}

enum result store_end(struct store *store, enum result result, struct error *err) {
    if (result == RESULT_OK && store->changes)
        result = change_keep(store, err);
    if (result == RESULT_OK)
        result = store_run(store, "COMMIT", err);
    if (store->changes)
        sqlite3session_delete(store->changes);
    store->changes = NULL;
    if (result != RESULT_OK && !sqlite3_get_autocommit(store->db))
        sqlite3_exec(store->db, "ROLLBACK", NULL, NULL, NULL);
    return result;
}
