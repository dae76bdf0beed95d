#include "store/change.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

// ---- gathering ----------------------------------------------------------------------------------

static int is_shared(void *user, const char *table) {
    static const char *const own[] = {"share", "change", "sender", "removed", "last_number"};
    (void)user;
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        if (!strcmp(table, own[i]))
            return 0;
    return 1;
}

sqlite3_session *change_begin(sqlite3 *db) {
    sqlite3_session *session = NULL;
    if (sqlite3session_create(db, "main", &session) != SQLITE_OK)
        return NULL;
    sqlite3session_table_filter(session, is_shared, NULL);
    if (sqlite3session_attach(session, NULL) != SQLITE_OK) {
        sqlite3session_delete(session);
        return NULL;
    }
    return session;
}

// *out_bytes: of sqlite3_malloc, or NULL if nothing was changed.
static int end_gathering(sqlite3_session **session, void **out_bytes, int *out_size) {
    *out_bytes = NULL;
    *out_size = 0;
    int code = sqlite3session_changeset(*session, out_size, out_bytes);
    sqlite3session_delete(*session);
    *session = NULL;
    if (!*out_size) {
        sqlite3_free(*out_bytes);
        *out_bytes = NULL;
    }
    return code;
}

// Runs a statement with a blob as ?1 and numbers as ?2 and ?3.
static int run_blob(sqlite3 *db, const char *sql, const void *bytes, int size, int64_t number,
                    bool flag) {
    sqlite3_stmt *statement;
    int code = sqlite3_prepare_v2(db, sql, -1, &statement, NULL);
    if (code == SQLITE_OK)
        code = size ? sqlite3_bind_blob(statement, 1, bytes, size, SQLITE_STATIC)
                    : sqlite3_bind_zeroblob(statement, 1, 0);
    if (code == SQLITE_OK)
        code = sqlite3_bind_int64(statement, 2, number);
    if (code == SQLITE_OK)
        code = sqlite3_bind_int(statement, 3, flag);
    if (code == SQLITE_OK)
        code = sqlite3_step(statement);
    sqlite3_finalize(statement);
    return code == SQLITE_DONE ? SQLITE_OK : code;
}

enum result change_keep(struct store *store, struct error *err) {
    void *bytes;
    int size;
    int code = end_gathering(&store->changes, &bytes, &size);
    if (code == SQLITE_OK && bytes)
        code = run_blob(store->db, "INSERT INTO change (bytes, number) VALUES (?1, nullif(?2, ?3))",
                        bytes, size, 0, false);
    sqlite3_free(bytes);
    if (code == SQLITE_OK && bytes && store->erases)
        code = sqlite3_exec(store->db, "UPDATE share SET erased = (SELECT max(number) FROM change)",
                            NULL, NULL, NULL);
    return code == SQLITE_OK ? RESULT_OK : store_failed(store, code, err);
}

// ---- what contradicts ---------------------------------------------------------------------------

// Rows whose key is made of what they say: two servers that make one mean the same row.
static bool says_its_key(const char *table) {
    static const char *const all[] = {"station", "knee_case",  "enrolment", "result",
                                      "part",    "exam_rater", "audit_seal"};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (!strcmp(table, all[i]))
            return true;
    return false;
}

#define TRAINEE_ERASED 4 // column

// What is said later counts, but for somebody who was erased.
static int on_other_values(const char *table, sqlite3_changeset_iter *change) {
    sqlite3_value *erased = NULL;
    if (!strcmp(table, "trainee") &&
        sqlite3changeset_conflict(change, TRAINEE_ERASED, &erased) == SQLITE_OK && erased &&
        sqlite3_value_type(erased) != SQLITE_NULL)
        return SQLITE_CHANGESET_OMIT;
    return SQLITE_CHANGESET_REPLACE;
}

static int on_conflict(void *user, int kind, sqlite3_changeset_iter *change) {
    const char *table = "";
    int columns, operation, indirect;
    (void)user;
    if (kind != SQLITE_CHANGESET_FOREIGN_KEY)
        sqlite3changeset_op(change, &table, &columns, &operation, &indirect);
    switch (kind) {
    case SQLITE_CHANGESET_DATA:
        return on_other_values(table, change);
    case SQLITE_CHANGESET_NOTFOUND:
        return SQLITE_CHANGESET_OMIT;
    case SQLITE_CHANGESET_CONFLICT:
        return says_its_key(table) ? SQLITE_CHANGESET_REPLACE : SQLITE_CHANGESET_ABORT;
    default:
        return SQLITE_CHANGESET_ABORT;
    }
}

// What refers to a row that a change removes, or to somebody whom it erases, although the server
// that made the change did not know it yet. ?1: the row's number.
static const struct {
    const char *table;
    bool erased;
    const char *sql;
} dependants[] = {
    {"account", false, "DELETE FROM token WHERE account_id = ?1"},
    {"course", false, "DELETE FROM enrolment WHERE course_id = ?1"},
    {"session", false, "DELETE FROM result WHERE session_id = ?1"},
    {"session", false, "DELETE FROM attempt WHERE session_id = ?1"},
    {"trainee", false, "UPDATE session SET trainee_id = NULL WHERE trainee_id = ?1"},
    {"trainee", true,
     "DELETE FROM token WHERE trainee_id = ?1 OR account_id IN "
     "(SELECT id FROM account WHERE trainee_id = ?1)"},
    {"trainee", true, "DELETE FROM enrolment WHERE trainee_id = ?1"},
    {"trainee", true, "DELETE FROM account WHERE trainee_id = ?1"},
    {"trainee", true, "DELETE FROM exam WHERE trainee_id = ?1"},
    {"trainee", true,
     "DELETE FROM attempt WHERE session_id IN (SELECT id FROM session WHERE trainee_id = ?1)"},
};

static int run_number(sqlite3 *db, const char *sql, int64_t number) {
    sqlite3_stmt *statement;
    int code = sqlite3_prepare_v2(db, sql, -1, &statement, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_bind_int64(statement, 1, number);
    if (code == SQLITE_OK)
        code = sqlite3_step(statement);
    sqlite3_finalize(statement);
    return code == SQLITE_DONE || code == SQLITE_ROW ? SQLITE_OK : code;
}

static int remove_dependants(sqlite3 *db, const char *table, bool erased, int64_t id) {
    int code = SQLITE_OK;
    for (size_t i = 0; i < sizeof dependants / sizeof *dependants && code == SQLITE_OK; i++)
        if (!strcmp(dependants[i].table, table) && (!erased || dependants[i].erased))
            code = run_number(db, dependants[i].sql, id);
    return code;
}

static int look_at_row(sqlite3 *db, sqlite3_changeset_iter *change) {
    const char *table;
    int columns, operation, indirect;
    sqlite3_value *id = NULL, *erased = NULL;
    int code = sqlite3changeset_op(change, &table, &columns, &operation, &indirect);
    if (code != SQLITE_OK || operation == SQLITE_INSERT)
        return code;
    if (operation == SQLITE_UPDATE && strcmp(table, "trainee") != 0)
        return SQLITE_OK;
    code = sqlite3changeset_old(change, 0, &id);
    if (code == SQLITE_OK && operation == SQLITE_UPDATE)
        code = sqlite3changeset_new(change, TRAINEE_ERASED, &erased);
    bool counts =
        operation == SQLITE_DELETE || (erased && sqlite3_value_type(erased) != SQLITE_NULL);
    return code == SQLITE_OK && counts && id
               ? remove_dependants(db, table, operation == SQLITE_UPDATE, sqlite3_value_int64(id))
               : code;
}

static int remove_what_depends(sqlite3 *db, const void *bytes, int size) {
    sqlite3_changeset_iter *change;
    int code = sqlite3changeset_start(&change, size, (void *)bytes);
    if (code != SQLITE_OK)
        return code;
    while (code == SQLITE_OK && (code = sqlite3changeset_next(change)) == SQLITE_ROW)
        code = look_at_row(db, change);
    int ended = sqlite3changeset_finalize(change);
    return code == SQLITE_DONE || code == SQLITE_OK ? ended : code;
}

// Names of somebody who was erased stay away, and a session's row is that of its last part,
// although a server that did not know of it wrote into the row.
static const char set_right[] =
    "UPDATE trainee SET full_name = NULL WHERE erased_utc_ns IS NOT NULL AND full_name IS NOT NULL;"
    "UPDATE session SET part = p.number, server = p.server, end_utc_ns = p.end_utc_ns, "
    "state = p.state, steps = p.steps, missing = p.missing, trace = p.trace, "
    "trace_xxh3 = p.trace_xxh3, trace_hash = p.trace_hash FROM part p "
    "WHERE p.session_id = session.id AND p.number = "
    "(SELECT max(number) FROM part WHERE session_id = session.id) AND "
    "(session.part, session.server, session.end_utc_ns, session.state, session.steps, "
    "session.missing, session.trace, session.trace_xxh3, session.trace_hash) IS NOT "
    "(p.number, p.server, p.end_utc_ns, p.state, p.steps, p.missing, p.trace, p.trace_xxh3, "
    "p.trace_hash);";

// ---- doing and undoing --------------------------------------------------------------------------

// No two servers make the same entry of the audit log, and none is undone.
static int is_audit(void *user, const char *table) {
    (void)user;
    return !strcmp(table, "audit");
}

static int is_not_audit(void *user, const char *table) {
    return !is_audit(user, table);
}

// *out_dropped: it contradicts the records, which are as before.
static int apply(sqlite3 *db, const void *bytes, int size, int (*filter)(void *, const char *),
                 int flags, bool *out_dropped) {
    int code = size ? sqlite3changeset_apply_v2(db, size, (void *)bytes, filter, on_conflict, NULL,
                                                NULL, NULL, flags)
                    : SQLITE_OK;
    *out_dropped = code == SQLITE_ABORT || (code & 0xff) == SQLITE_CONSTRAINT;
    return *out_dropped ? SQLITE_OK : code;
}

static int apply_audit(sqlite3 *db, const void *bytes, int size) {
    bool contradicts;
    int code = apply(db, bytes, size, is_audit, 0, &contradicts);
    return contradicts ? SQLITE_CORRUPT : code;
}

static int exec(sqlite3 *db, const char *sql) {
    return sqlite3_exec(db, sql, NULL, NULL, NULL);
}

// All but the audit log.
static int apply_rest(sqlite3 *db, const void *bytes, int size, bool *out_dropped) {
    *out_dropped = false;
    int code = exec(db, "SAVEPOINT one; PRAGMA defer_foreign_keys = ON");
    if (code == SQLITE_OK)
        code = remove_what_depends(db, bytes, size);
    if (code == SQLITE_OK)
        code = apply(db, bytes, size, is_not_audit, 0, out_dropped);
    if (code == SQLITE_OK)
        code = exec(db, *out_dropped ? "ROLLBACK TO one" : set_right);
    int ended = exec(db, "RELEASE one");
    return code == SQLITE_OK ? ended : code;
}

// Has the effect of each one that was done.
struct pending {
    int64_t number;
    void *bytes, *effect;
    int size, effect_size;
};

struct pending_list {
    struct pending *at;
    size_t count;
};

static void release(struct pending_list *list) {
    for (size_t i = 0; i < list->count; i++) {
        free(list->at[i].bytes);
        free(list->at[i].effect);
    }
    free(list->at);
}

static void *copy_blob(sqlite3_stmt *statement, int column, int *out_size) {
    *out_size = sqlite3_column_bytes(statement, column);
    void *copy = alloc(1, (size_t)*out_size + 1);
    if (*out_size)
        memcpy(copy, sqlite3_column_blob(statement, column), (size_t)*out_size);
    return copy;
}

static int read_pending(sqlite3 *db, struct pending_list *out) {
    sqlite3_stmt *statement;
    *out = (struct pending_list){0};
    int code = sqlite3_prepare_v2(db,
                                  "SELECT number, bytes, ifnull(effect, bytes) FROM change "
                                  "ORDER BY number",
                                  -1, &statement, NULL);
    while (code == SQLITE_OK && (code = sqlite3_step(statement)) == SQLITE_ROW) {
        out->at = alloc_resize(out->at, out->count + 1, sizeof *out->at);
        struct pending *p = &out->at[out->count++];
        p->number = sqlite3_column_int64(statement, 0);
        p->bytes = copy_blob(statement, 1, &p->size);
        p->effect = copy_blob(statement, 2, &p->effect_size);
        code = SQLITE_OK;
    }
    sqlite3_finalize(statement);
    return code == SQLITE_DONE ? SQLITE_OK : code;
}

static int undo(sqlite3 *db, const struct pending *p) {
    bool contradicts;
    int code = apply(db, p->effect, p->effect_size, is_not_audit, SQLITE_CHANGESETAPPLY_INVERT,
                     &contradicts);
    return contradicts ? SQLITE_CORRUPT : code;
}

// A session that is undone is not removed: its trace stays.
static int undo_all(sqlite3 *db, const struct pending_list *list) {
    int code = exec(db, "CREATE TEMP TABLE kept AS SELECT trace FROM removed");
    for (size_t i = list->count; i-- > 0 && code == SQLITE_OK;)
        code = undo(db, &list->at[i]);
    if (code == SQLITE_OK)
        code = exec(db, "DELETE FROM removed; INSERT INTO removed SELECT trace FROM kept");
    int dropped = exec(db, "DROP TABLE IF EXISTS temp.kept");
    return code == SQLITE_OK ? dropped : code;
}

static int do_again(sqlite3 *db, const struct pending *p) {
    sqlite3_session *session = change_begin(db);
    void *effect;
    int size;
    bool dropped;
    if (!session)
        return SQLITE_NOMEM;
    int code = apply_rest(db, p->bytes, p->size, &dropped);
    int ended = end_gathering(&session, &effect, &size);
    if (code == SQLITE_OK)
        code = ended;
    if (code == SQLITE_OK)
        code = run_blob(db, "UPDATE change SET effect = ?1, dropped = ?3 WHERE number = ?2", effect,
                        size, p->number, dropped);
    sqlite3_free(effect);
    return code;
}

int change_do_between(sqlite3 *db, const struct store_change *between, bool *out_dropped) {
    struct pending_list list;
    *out_dropped = false;
    int code = read_pending(db, &list);
    if (code == SQLITE_OK)
        code = undo_all(db, &list);
    if (code == SQLITE_OK)
        code = apply_audit(db, between->bytes, (int)between->size);
    if (code == SQLITE_OK)
        code = apply_rest(db, between->bytes, (int)between->size, out_dropped);
    for (size_t i = 0; i < list.count && code == SQLITE_OK; i++)
        code = do_again(db, &list.at[i]);
    release(&list);
    return code;
}

int change_do_all(sqlite3 *db) {
    struct pending_list list;
    int code = read_pending(db, &list);
    for (size_t i = 0; i < list.count && code == SQLITE_OK; i++) {
        code = apply_audit(db, list.at[i].bytes, list.at[i].size);
        if (code == SQLITE_OK)
            code = do_again(db, &list.at[i]);
    }
    release(&list);
    return code;
}
