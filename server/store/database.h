// What the files of this room share: an open database, statements, and what SQLite answers in our
// words.
#pragma once

#include "store/store.h"

#include <sqlite3.h>

#define STORE_STATEMENTS_MAX 32

struct store {
    sqlite3 *db;
    char *path, *actor;
    int lock_fd;
    // Prepared once, by the address of their text.
    struct statement {
        const char *sql;
        sqlite3_stmt *prepared;
    } statements[STORE_STATEMENTS_MAX];
    int statement_count;
};

// Our word for what the database answered last, in a sentence with the file's path.
enum result database_failed(sqlite3 *db, const char *path, int code, struct error *err);

// Takes the lock of `path` for whoever has the records open, or alone; RESULT_TIMEOUT where others
// keep it.
enum result database_lock(const char *path, bool alone, int *out_fd, struct error *err);

// A database that is ours and of a version that we know, as it is; nothing is brought up to date.
// flags: SQLITE_OPEN_READONLY or _READWRITE; with SQLITE_OPEN_CREATE it may be new or empty.
enum result database_open(const char *path, int flags, sqlite3 **out_db, struct error *err);
enum result database_version(sqlite3 *db, const char *path, int *out_version, struct error *err);

// RESULT_CORRUPT where its pages or the references between its rows do not hold.
enum result database_check(sqlite3 *db, const char *path, struct error *err);

enum result store_run(struct store *store, const char *sql, struct error *err); // without values
enum result store_failed(struct store *store, int code, struct error *err);

// A statement of a literal, ready for values: "store_prepare(store, sql, "ti", name, id)", where t
// is a text (NULL: none), i an int64_t and r a double (not finite: none). The caller resets it.
enum result store_prepare(struct store *store, const char *sql, sqlite3_stmt **out,
                          struct error *err, const char *kinds, ...);
// The same, run to its end, at which nothing of it stays open.
enum result store_do(struct store *store, const char *sql, struct error *err, const char *kinds,
                     ...);
// The first column of the first row: RESULT_MISSING where there is no row (err says nothing then).
enum result store_find(struct store *store, const char *sql, int64_t *out, struct error *err,
                       const char *kinds, ...);

// Gives the rows of a prepared statement to the taker, and resets it.
enum result store_give(struct store *store, sqlite3_stmt *statement, store_row_handler take,
                       void *user, struct error *err);

// Ends what "BEGIN IMMEDIATE" began: all of it where `result` is RESULT_OK, else none. Returns
// `result`, or why it could not end.
enum result store_end(struct store *store, enum result result, struct error *err);
enum result store_begin(struct store *store, struct error *err);

// The number of what has this name: RESULT_MISSING names the records, what it is and its name.
enum result store_find_named(struct store *store, const char *sql, const char *what,
                             const char *name, int64_t *out_id, struct error *err);

// RESULT_REFUSED where something has that name already; what: "a trainee".
enum result store_must_be_new(struct store *store, const char *sql, const char *what,
                              const char *name, struct error *err);

// As store_end, behind an INSERT of a `kind`, which goes into the audit log.
enum result store_end_added(struct store *store, enum result result, const char *kind,
                            struct error *err);

// A line of the audit log about "kind id"; without personal data (a trainee by number), for it is
// never changed. id 0: there is but one.
enum result store_audit(struct store *store, const char *action, const char *kind, int64_t id,
                        struct error *err);

// Encoded by argon2, as store_add_account says.
enum result store_check_password(const char *password, struct error *err);
