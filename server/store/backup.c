// Copies of the whole file, made and put back.
#include "base/check.h"
#include "base/clock.h"
#include "store/change.h"
#include "store/database.h"
#include "store/share.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define PAGES_A_TURN 256
#define PATIENCE_NS (10 * NS_PER_S)
#define ASIDE_MAX 100
#define SHARED_VERSION 7 // of the first tables that servers share

static enum result name_beside(const char *path, const char *more, char *out, size_t size,
                               struct error *err) {
    size_t length = strlen(path), beside = strlen(more) + 1;
    if (length + beside > size)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", path);
    memcpy(out, path, length);
    memcpy(out + length, more, beside);
    return RESULT_OK;
}

static enum result make_new(const char *path, struct error *err) {
    int fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return fail(err, errno == EEXIST ? RESULT_REFUSED : RESULT_IO, "%s: %s", path,
                    strerror(errno));
    close(fd);
    return RESULT_OK;
}

static enum result sync_path(const char *path, int flags, struct error *err) {
    int fd = open(path, flags | O_CLOEXEC);
    int failed = fd < 0 || fsync(fd);
    if (failed)
        fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (fd >= 0)
        close(fd);
    return failed ? RESULT_IO : RESULT_OK;
}

static enum result sync_file_and_folder(const char *path, struct error *err) {
    char *copy = alloc_text(path);
    enum result result = sync_path(path, O_RDONLY, err);
    if (result == RESULT_OK)
        result = sync_path(dirname(copy), O_RDONLY | O_DIRECTORY, err);
    free(copy);
    return result;
}

// ---- copying ------------------------------------------------------------------------------------

// Others may write between two turns; the copy contains those changes too.
static int copy_pages(sqlite3 *from, sqlite3 *to) {
    sqlite3_backup *backup = sqlite3_backup_init(to, "main", from, "main");
    if (!backup)
        return sqlite3_errcode(to);
    int64_t end_ns = clock_now_ns() + PATIENCE_NS;
    int code;
    while ((code = sqlite3_backup_step(backup, PAGES_A_TURN)) != SQLITE_DONE) {
        bool waits = code == SQLITE_BUSY || code == SQLITE_LOCKED;
        if ((code != SQLITE_OK && !waits) || clock_now_ns() > end_ns)
            break;
        if (waits)
            sqlite3_sleep(10);
    }
    sqlite3_backup_finish(backup);
    return code == SQLITE_OK ? SQLITE_BUSY : code;
}

// The error of copying: missing space is the target's.
static enum result copy_failed(const char *from_path, const char *to_name, int code,
                               struct error *err) {
    int kind = code & 0xff;
    bool is_target = kind == SQLITE_FULL || kind == SQLITE_IOERR || kind == SQLITE_READONLY ||
                     kind == SQLITE_CANTOPEN;
    return database_failed(NULL, is_target ? to_name : from_path, code, err);
}

// Copies into a new file without a log beside it, checks it and syncs it. to_name: its final name,
// for errors.
static enum result copy_checked(sqlite3 *from, const char *from_path, const char *to_path,
                                const char *to_name, struct error *err) {
    sqlite3 *to = NULL;
    enum result result = make_new(to_path, err);
    if (result != RESULT_OK)
        return result;
    int code = sqlite3_open_v2(to_path, &to, SQLITE_OPEN_READWRITE, NULL);
    if (code != SQLITE_OK)
        result = database_failed(to, to_name, code, err);
    if (result == RESULT_OK && (code = copy_pages(from, to)) != SQLITE_DONE)
        result = copy_failed(from_path, to_name, code, err);
    if (result == RESULT_OK)
        result = database_check(to, from_path, err);
    if (result == RESULT_OK &&
        (code = sqlite3_exec(to, "PRAGMA journal_mode = DELETE", NULL, NULL, NULL)) != SQLITE_OK)
        result = database_failed(to, to_name, code, err);
    sqlite3_close(to);
    if (result == RESULT_OK)
        result = sync_file_and_folder(to_path, err);
    if (result != RESULT_OK)
        unlink(to_path);
    return result;
}

// Under its own name only once it is whole.
enum result store_backup(struct store *store, const char *out_path, struct error *err) {
    char part[PATH_MAX];
    enum result result = name_beside(out_path, ".part", part, sizeof part, err);
    if (result == RESULT_OK && access(out_path, F_OK) == 0)
        result =
            fail(err, RESULT_REFUSED, "%s: this file already exists; name another file", out_path);
    if (result != RESULT_OK)
        return result;
    unlink(part); // of a backup that was interrupted
    result = copy_checked(store->db, store->path, part, out_path, err);
    if (result == RESULT_OK && link(part, out_path))
        result = fail(err, RESULT_IO, "%s: %s", out_path, strerror(errno));
    unlink(part);
    if (result != RESULT_OK)
        return result;
    result = sync_file_and_folder(out_path, err);
    if (result != RESULT_OK) // whoever is told that there is no backup finds none
        unlink(out_path);
    return result;
}

// ---- restoring ----------------------------------------------------------------------------------

// The advice of the records' own errors is to restore a backup, which this one should be.
static enum result describe_backup(const char *backup, enum result result, struct error *err) {
    if (result == RESULT_FORMAT)
        return fail(err, result, "%s: this file is not a backup of arthron-server's records",
                    backup);
    if (result == RESULT_CORRUPT)
        return fail(err, result, "%s: this backup is damaged; restore another one", backup);
    return result;
}

static enum result read_backup(const char *backup, const char *fresh, const char *path,
                               struct error *err) {
    sqlite3 *db;
    enum result result = database_open(backup, SQLITE_OPEN_READONLY, &db, err);
    if (result != RESULT_OK)
        return describe_backup(backup, result, err);
    result = copy_checked(db, backup, fresh, path, err);
    sqlite3_close(db);
    return describe_backup(backup, result, err);
}

static enum result free_name(const char *path, char *out, size_t size, struct error *err) {
    char when[32];
    time_t now = time(NULL);
    struct tm utc;
    strftime(when, sizeof when, "%Y%m%dT%H%M%SZ", gmtime_r(&now, &utc));
    for (int i = 0; i < ASIDE_MAX; i++) {
        char more[64] = "";
        snprintf(more, sizeof more, i ? ".replaced-%s-%d" : ".replaced-%s", when, i);
        enum result result = name_beside(path, more, out, size, err);
        if (result != RESULT_OK || access(out, F_OK))
            return result;
    }
    return fail(err, RESULT_REFUSED,
                "%s: %d replaced files are kept beside it; move some of them away", path,
                ASIDE_MAX);
}

// Merges the log beside the file into it, so that the file can be moved. A file that is too damaged
// for that is moved together with its log.
static enum result settle(const char *path, struct error *err) {
    sqlite3 *db;
    struct error why;
    enum result result = database_open(path, SQLITE_OPEN_READWRITE, &db, &why);
    if (result == RESULT_OK) {
        int code = sqlite3_exec(db, "PRAGMA journal_mode = DELETE", NULL, NULL, NULL);
        if (code != SQLITE_OK)
            result = database_failed(db, path, code, &why);
        sqlite3_close(db);
    }
    if (result == RESULT_TIMEOUT || result == RESULT_IO)
        return fail(err, result, "%s", why.text);
    return RESULT_OK;
}

static enum result move_file(const char *path, const char *to, const char *more,
                             struct error *err) {
    char from_name[PATH_MAX], to_name[PATH_MAX];
    enum result result = name_beside(path, more, from_name, sizeof from_name, err);
    if (result == RESULT_OK)
        result = name_beside(to, more, to_name, sizeof to_name, err);
    if (result == RESULT_OK && rename(from_name, to_name) && errno != ENOENT)
        result = fail(err, RESULT_IO, "%s: %s", from_name, strerror(errno));
    return result;
}

// The log before its file: another file must never meet it.
static enum result put_aside(const char *path, char *out_aside, struct error *err) {
    out_aside[0] = '\0';
    if (access(path, F_OK))
        return errno == ENOENT ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    enum result result = settle(path, err);
    if (result == RESULT_OK)
        result = free_name(path, out_aside, STORE_TEXT_MAX, err);
    if (result == RESULT_OK)
        result = move_file(path, out_aside, "-wal", err);
    if (result == RESULT_OK)
        result = move_file(path, out_aside, "-shm", err);
    if (result == RESULT_OK && link(path, out_aside))
        result = fail(err, RESULT_IO, "%s: %s", out_aside, strerror(errno));
    return result;
}

static enum result tell_audit(const char *path, const char *actor, struct error *err) {
    struct store *store;
    enum result result = store_open(path, STORE_THERE, actor, &store, err);
    if (result == RESULT_OK)
        result = store_audit(store, "restore", "records", 0, err);
    store_close(&store);
    return result;
}

// Root may put it back for the user that the server runs as.
static enum result keep_owner(const char *fresh, const char *path, struct error *err) {
    struct stat status;
    if (geteuid() != 0)
        return RESULT_OK;
    if (stat(path, &status) != 0)
        return errno == ENOENT ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (chown(fresh, status.st_uid, status.st_gid) == 0)
        return RESULT_OK;
    return fail(err, RESULT_IO, "%s: %s", fresh, strerror(errno));
}

static enum result exchange(const char *fresh, const char *path, char *out_aside,
                            struct error *err) {
    enum result result = keep_owner(fresh, path, err);
    if (result == RESULT_OK)
        result = put_aside(path, out_aside, err);
    if (result == RESULT_OK && rename(fresh, path))
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return result == RESULT_OK ? sync_file_and_folder(path, err) : result;
}

// It joins the others again, if there are any. A backup of older tables knows none.
static enum result leave_others(const char *fresh, const char *path, struct error *err) {
    sqlite3 *db = NULL;
    int version = 0;
    enum result result = database_open(fresh, SQLITE_OPEN_READWRITE, &db, err);
    if (result == RESULT_OK)
        result = database_version(db, path, &version, err);
    int code = result == RESULT_OK && version >= SHARED_VERSION
                   ? sqlite3_exec(db, share_end, NULL, NULL, NULL)
                   : SQLITE_OK;
    sqlite3_close(db);
    return code == SQLITE_OK ? result : database_failed(NULL, path, code, err);
}

enum result store_restore(const char *backup, const char *path, const char *actor,
                          char out_aside[STORE_TEXT_MAX], struct error *err) {
    char fresh[PATH_MAX];
    int lock = -1;
    out_aside[0] = '\0';
    enum result result = name_beside(path, ".restoring", fresh, sizeof fresh, err);
    if (result == RESULT_OK)
        result = database_lock(path, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    unlink(fresh); // of a restore that was interrupted: the lock is ours
    result = read_backup(backup, fresh, path, err);
    if (result == RESULT_OK)
        result = leave_others(fresh, path, err);
    if (result == RESULT_OK)
        result = exchange(fresh, path, out_aside, err);
    unlink(fresh);
    close(lock);
    return result == RESULT_OK ? tell_audit(path, actor, err) : result;
}

// ---- records that servers share -----------------------------------------------------------------

enum result store_share_copy(struct store *store, const char *path, int64_t *out_place,
                             struct error *err) {
    struct store_share share = {0};
    int64_t waiting = 0;
    enum result result = store_run(store, "BEGIN", err); // of one moment
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT count(*) FROM change", &waiting, err, "");
    if (result == RESULT_OK)
        result = store_share(store, &share, err);
    *out_place = share.applied;
    if (result == RESULT_OK && waiting)
        result = fail(err, RESULT_TIMEOUT, "%s: %lld changes are on their way", store->path,
                      (long long)waiting);
    unlink(path);
    if (result == RESULT_OK)
        result = copy_checked(store->db, store->path, path, path, err);
    return store_end(store, result, err);
}

static const char take_pending[] =
    "INSERT INTO main.change (number, bytes) SELECT number, bytes FROM old.change WHERE number > "
    "ifnull((SELECT number FROM main.sender WHERE slot = (SELECT slot FROM main.share)), 0);"
    "UPDATE main.share SET dropped = (SELECT dropped FROM old.share), "
    "erased = (SELECT erased FROM old.share);";

// So that this server goes on counting where it was.
static const char take_number[] =
    "DELETE FROM sqlite_sequence WHERE name = 'change';"
    "INSERT INTO sqlite_sequence (name, seq) VALUES ('change', ifnull((SELECT number FROM sender "
    "WHERE slot = (SELECT slot FROM share)), 0));";

static int write_member(sqlite3 *db, const struct store_member *self) {
    char *sql =
        sqlite3_mprintf("DELETE FROM change; DELETE FROM removed;"
                        "UPDATE share SET server = %Q, shared_order = %Q, file = %Q, "
                        "slot = %d, step = %d, dropped = 0, erased = 0;",
                        self->server, self->order, self->file, self->slot, STORE_SERVERS_MAX);
    int code = sql ? sqlite3_exec(db, sql, NULL, NULL, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    return code == SQLITE_OK ? sqlite3_exec(db, take_number, NULL, NULL, NULL) : code;
}

static int attach(sqlite3 *db, const char *path) {
    char *sql = sqlite3_mprintf("ATTACH %Q AS old", path);
    int code = sql ? sqlite3_exec(db, sql, NULL, NULL, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    return code;
}

static int do_pending(sqlite3 *db) {
    int code = sqlite3_exec(db, "PRAGMA foreign_keys = ON; BEGIN", NULL, NULL, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_exec(db, take_pending, NULL, NULL, NULL);
    if (code == SQLITE_OK)
        code = change_do_all(db);
    return code == SQLITE_OK ? sqlite3_exec(db, "COMMIT", NULL, NULL, NULL) : code;
}

// old: the records before, of the same server; NULL: there are none.
static enum result become(const char *fresh, const char *old, const struct store_member *self,
                          struct error *err) {
    sqlite3 *db = NULL;
    int code = sqlite3_open_v2(fresh, &db, SQLITE_OPEN_READWRITE, NULL);
    if (code == SQLITE_OK)
        code = write_member(db, self);
    if (code == SQLITE_OK && old)
        code = attach(db, old);
    if (code == SQLITE_OK && old)
        code = do_pending(db);
    enum result result = code == SQLITE_OK ? RESULT_OK : database_failed(db, fresh, code, err);
    sqlite3_close(db);
    return result;
}

// Whether the records there are this member's. What is no such file, is none.
static enum result is_same_file(const char *path, const struct store_member *self, bool *out_same,
                                struct error *err) {
    sqlite3 *db = NULL;
    struct error why;
    char *sql = sqlite3_mprintf("SELECT 1 FROM share WHERE server = %Q AND shared_order = %Q AND "
                                "file = %Q AND slot = %d",
                                self->server, self->order, self->file, self->slot);
    sqlite3_stmt *statement = NULL;
    enum result result = database_open(path, SQLITE_OPEN_READWRITE, &db, &why);
    *out_same = result == RESULT_OK && sql &&
                sqlite3_prepare_v2(db, sql, -1, &statement, NULL) == SQLITE_OK &&
                sqlite3_step(statement) == SQLITE_ROW;
    sqlite3_finalize(statement);
    sqlite3_close(db);
    sqlite3_free(sql);
    return result == RESULT_TIMEOUT || result == RESULT_IO ? fail(err, result, "%s", why.text)
                                                           : RESULT_OK;
}

enum result store_share_load(const char *copy, const char *path, const struct store_member *self,
                             char out_aside[STORE_TEXT_MAX], struct error *err) {
    char fresh[PATH_MAX];
    int lock = -1;
    bool same = false;
    out_aside[0] = '\0';
    enum result result = name_beside(path, ".restoring", fresh, sizeof fresh, err);
    if (result == RESULT_OK)
        result = database_lock(path, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    unlink(fresh);
    result = is_same_file(path, self, &same, err);
    if (result == RESULT_OK)
        result = read_backup(copy, fresh, path, err);
    if (result == RESULT_OK)
        result = become(fresh, same ? path : NULL, self, err);
    if (result == RESULT_OK)
        result = exchange(fresh, path, out_aside, err);
    if (result == RESULT_OK && same) {
        unlink(out_aside);
        out_aside[0] = '\0';
    }
    unlink(fresh);
    close(lock);
    return result;
}
