#include "store/database.h"

#include "base/check.h"
#include "base/clock.h"
#include "store/schema.h"
#include "store/text.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

#define BUSY_MS 4000 // a busy disk syncs a new file for longer than a second
#define LOCK_ROUND_MS 10

// ---- errors -------------------------------------------------------------------------------------

enum result database_failed(sqlite3 *db, const char *path, int code, struct error *err) {
    const char *text = db ? sqlite3_errmsg(db) : sqlite3_errstr(code);
    switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
        return fail(err, RESULT_TIMEOUT,
                    "%s: another program has locked the records; stop it, or try again", path);
    case SQLITE_CORRUPT:
        return fail(err, RESULT_CORRUPT,
                    "%s: the records are damaged (%s); restore a backup with 'arthron-server "
                    "restore BACKUP --file %s'",
                    path, text, path);
    case SQLITE_NOTADB:
        return fail(err, RESULT_FORMAT,
                    "%s: this file is not a database, or its beginning is destroyed; name another "
                    "file, or restore a backup with 'arthron-server restore BACKUP --file %s'",
                    path, path);
    case SQLITE_CONSTRAINT:
        return fail(err, RESULT_REFUSED, "%s: %s", path, text);
    case SQLITE_ERROR:
    case SQLITE_SCHEMA:
    case SQLITE_MISMATCH:
        return fail(err, RESULT_FORMAT,
                    "%s: its tables are not those of arthron-server (%s); restore a backup", path,
                    text);
    case SQLITE_FULL:
        return fail(err, RESULT_IO, "%s: the disk is full", path);
    default:
        return fail(err, RESULT_IO,
                    "%s: %s; check the space on its disk and the file's permissions", path, text);
    }
}

enum result store_failed(struct store *store, int code, struct error *err) {
    return database_failed(store->db, store->path, code, err);
}

// ---- the lock beside the file -------------------------------------------------------------------

static void wait_a_round(void) {
    nanosleep(&(struct timespec){0, LOCK_ROUND_MS * NS_PER_MS}, NULL);
}

// SQLite's own locks are on the file, and a restore exchanges the file.
enum result database_lock(const char *path, bool alone, int *out_fd, struct error *err) {
    char lock[PATH_MAX];
    if (snprintf(lock, sizeof lock, "%s-lock", path) >= (int)sizeof lock)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", path);
    int fd = open(lock, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", lock, strerror(errno));
    for (int waited = 0; flock(fd, (alone ? LOCK_EX : LOCK_SH) | LOCK_NB);
         waited += LOCK_ROUND_MS) {
        if (waited >= BUSY_MS) {
            close(fd);
            return fail(err, RESULT_TIMEOUT, "%s: another arthron-server %s; try again later", path,
                        alone ? "has the records open" : "is restoring a backup");
        }
        wait_a_round();
    }
    *out_fd = fd;
    return RESULT_OK;
}

// ---- opening ------------------------------------------------------------------------------------

static enum result reach_file(const char *path, int flags, struct error *err) {
    int access_mode = flags & SQLITE_OPEN_READONLY ? O_RDONLY : O_RDWR;
    int fd = open(path, access_mode | O_CLOEXEC | (flags & SQLITE_OPEN_CREATE ? O_CREAT : 0), 0600);
    if (fd < 0 && errno == ENOENT)
        return fail(err, RESULT_MISSING, "%s: this file does not exist", path);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    close(fd);
    return RESULT_OK;
}

static enum result read_number(sqlite3 *db, const char *path, const char *sql, int64_t *out,
                               struct error *err) {
    sqlite3_stmt *statement;
    int code = sqlite3_prepare_v2(db, sql, -1, &statement, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_step(statement);
    if (code == SQLITE_ROW)
        *out = sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return code == SQLITE_ROW ? RESULT_OK : database_failed(db, path, code, err);
}

enum result database_version(sqlite3 *db, const char *path, int *out_version, struct error *err) {
    int64_t version = 0;
    enum result result = read_number(db, path, "PRAGMA user_version", &version, err);
    *out_version = (int)version;
    return result;
}

struct owner {
    int64_t id, tables;
    int version;
};

// Of one moment, as somebody else may just be making the file.
static enum result read_owner(sqlite3 *db, const char *path, struct owner *out, struct error *err) {
    sqlite3_exec(db, "BEGIN", NULL, NULL, NULL);
    enum result result = read_number(db, path, "PRAGMA application_id", &out->id, err);
    if (result == RESULT_OK)
        result = read_number(db, path, "SELECT count(*) FROM sqlite_schema", &out->tables, err);
    if (result == RESULT_OK)
        result = database_version(db, path, &out->version, err);
    sqlite3_exec(db, "ROLLBACK", NULL, NULL, NULL);
    return result;
}

static bool is_empty(const struct owner *owner) {
    return !owner->id && !owner->tables && !owner->version;
}

// A server that starts makes the file first, and its tables a moment later.
static enum result await_owner(sqlite3 *db, const char *path, struct owner *out,
                               struct error *err) {
    enum result result = read_owner(db, path, out, err);
    for (int waited = 0; result == RESULT_OK && is_empty(out) && waited < BUSY_MS;
         waited += LOCK_ROUND_MS) {
        wait_a_round();
        result = read_owner(db, path, out, err);
    }
    return result;
}

// An empty file becomes ours where one may be made; any other must be.
static enum result check_owner(sqlite3 *db, const char *path, bool make, struct error *err) {
    struct owner owner = {0};
    enum result result =
        make ? read_owner(db, path, &owner, err) : await_owner(db, path, &owner, err);
    if (result != RESULT_OK)
        return result;
    int64_t id = owner.id;
    int version = owner.version;
    if (id != STORE_APPLICATION_ID && !(make && is_empty(&owner)))
        return fail(err, RESULT_FORMAT,
                    "%s: this file does not hold records of arthron-server; name another file",
                    path);
    if (version > schema_version)
        return fail(
            err, RESULT_VERSION,
            "%s: a newer arthron-server made these records (version %d; this one reads up to %d); "
            "install that one, or restore an older backup",
            path, version, schema_version);
    if (version < 0 || (id && !version))
        return fail(err, RESULT_FORMAT,
                    "%s: the records have version %d, which does not exist; restore a backup", path,
                    version);
    return RESULT_OK;
}

enum result database_open(const char *path, int flags, sqlite3 **out_db, struct error *err) {
    enum result result = reach_file(path, flags, err);
    sqlite3 *db = NULL;
    *out_db = NULL;
    if (result != RESULT_OK)
        return result;
    int code = sqlite3_open_v2(path, &db, flags, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_busy_timeout(db, BUSY_MS);
    if (code == SQLITE_OK)
        code = sqlite3_exec(db, "PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;", NULL,
                            NULL, NULL);
    result = code == SQLITE_OK ? check_owner(db, path, flags & SQLITE_OPEN_CREATE, err)
                               : database_failed(db, path, code, err);
    if (result == RESULT_OK)
        *out_db = db;
    else
        sqlite3_close(db);
    return result;
}

// The pragma answers `expected` (NULL: no row), or describes the damage.
static enum result expect(sqlite3 *db, const char *path, const char *pragma, const char *expected,
                          struct error *err) {
    sqlite3_stmt *statement;
    int code = sqlite3_prepare_v2(db, pragma, -1, &statement, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_step(statement);
    enum result result = RESULT_OK;
    const char *text = code == SQLITE_ROW ? (const char *)sqlite3_column_text(statement, 0) : NULL;
    if (code != SQLITE_ROW && code != SQLITE_DONE)
        result = database_failed(db, path, code, err);
    else if ((text || expected) && (!text || !expected || strcmp(text, expected) != 0))
        result = fail(err, RESULT_CORRUPT, "%s: the records are damaged: %s", path,
                      text ? text : "no answer");
    sqlite3_finalize(statement);
    return result;
}

enum result database_check(sqlite3 *db, const char *path, struct error *err) {
    enum result result = expect(db, path, "PRAGMA integrity_check(1)", "ok", err);
    if (result == RESULT_OK)
        result = expect(db, path, "PRAGMA foreign_key_check", NULL, err);
    return result;
}

// ---- versions -----------------------------------------------------------------------------------

// Another program may be doing the same: the version counts that is found once nobody else writes.
static enum result apply_step(struct store *store, bool *out_there, struct error *err) {
    char sql[96];
    int version;
    *out_there = false;
    enum result result = store_run(store, "BEGIN IMMEDIATE", err);
    if (result != RESULT_OK)
        return result;
    result = database_version(store->db, store->path, &version, err);
    if (result == RESULT_OK && version >= schema_version) {
        *out_there = true;
        return store_end(store, result, err);
    }
    snprintf(sql, sizeof sql, "PRAGMA application_id = %d; PRAGMA user_version = %d;",
             STORE_APPLICATION_ID, version + 1);
    if (result == RESULT_OK)
        result = store_run(store, schema_steps[version], err);
    if (result == RESULT_OK)
        result = store_run(store, sql, err);
    return store_end(store, result, err);
}

static enum result migrate(struct store *store, struct error *err) {
    int version;
    enum result result = database_version(store->db, store->path, &version, err);
    for (bool there = version >= schema_version; result == RESULT_OK && !there;)
        result = apply_step(store, &there, err);
    return result;
}

// SQLite does not wait for other connections when a file changes to WAL.
static enum result use_wal(struct store *store, struct error *err) {
    int code = SQLITE_BUSY;
    for (int waited = 0; code == SQLITE_BUSY && waited <= BUSY_MS; waited += LOCK_ROUND_MS) {
        if (waited)
            wait_a_round();
        code = sqlite3_exec(store->db, "PRAGMA journal_mode = WAL", NULL, NULL, NULL);
    }
    return code == SQLITE_OK ? RESULT_OK : store_failed(store, code, err);
}

enum result store_open(const char *path, enum store_mode mode, const char *actor,
                       struct store **out_store, struct error *err) {
    struct store *store = alloc(1, sizeof *store);
    store->path = alloc_text(path);
    store->actor = alloc_text(actor);
    store->lock_fd = -1;
    enum result result = RESULT_OK;
    if (mode == STORE_THERE && access(path, F_OK))
        result = errno == ENOENT ? fail(err, RESULT_MISSING, "%s: this file does not exist", path)
                                 : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (result == RESULT_OK)
        result = database_lock(path, false, &store->lock_fd, err);
    if (result == RESULT_OK)
        result = database_open(
            path, SQLITE_OPEN_READWRITE | (mode == STORE_MAKE ? SQLITE_OPEN_CREATE : 0), &store->db,
            err);
    if (result == RESULT_OK)
        result = use_wal(store, err);
    if (result == RESULT_OK)
        result = store_run(store,
                           "PRAGMA synchronous = FULL;"
                           "PRAGMA foreign_keys = ON; PRAGMA secure_delete = ON;",
                           err);
    if (result == RESULT_OK)
        result = store_add_functions(store, err);
    if (result == RESULT_OK)
        result = migrate(store, err);
    if (result != RESULT_OK)
        store_close(&store);
    *out_store = store;
    return result;
}

void store_set_actor(struct store *store, const char *actor) {
    free(store->actor);
    store->actor = alloc_text(actor);
}

void store_close(struct store **store) {
    struct store *s = *store;
    if (!s)
        return;
    for (int i = 0; i < s->statement_count; i++)
        sqlite3_finalize(s->statements[i].prepared);
    sqlite3_close(s->db);
    if (s->lock_fd >= 0)
        close(s->lock_fd);
    free(s->path);
    free(s->actor);
    free(s);
    *store = NULL;
}
