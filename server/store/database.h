// Shared by the files of this room: the open database, its statements, and errors of SQLite in our
// words.
#pragma once

#include "store/store.h"

#include <sqlite3.h>

#define STORE_STATEMENTS_MAX 64

struct store {
    sqlite3 *db;
    char *path, *actor;
    int lock_fd;
    sqlite3_session *changes; // of the transaction that is open, where the records are shared
    bool erases;              // it erases a person
    // Prepared once, by the address of their text.
    struct statement {
        const char *sql;
        sqlite3_stmt *prepared;
    } statements[STORE_STATEMENTS_MAX];
    int statement_count;
};

// Our result for the database's last error code, and a sentence with the file's path.
enum result database_failed(sqlite3 *db, const char *path, int code, struct error *err);

// Takes the lock of `path`, shared with others who have the records open, or alone. RESULT_TIMEOUT
// if others keep it.
enum result database_lock(const char *path, bool alone, int *out_fd, struct error *err);

// Opens a database that is ours and of a version that we know, without upgrading it.
// flags: SQLITE_OPEN_READONLY or _READWRITE; with SQLITE_OPEN_CREATE it may be new or empty.
enum result database_open(const char *path, int flags, sqlite3 **out_db, struct error *err);
enum result database_version(sqlite3 *db, const char *path, int *out_version, struct error *err);

// RESULT_CORRUPT if its pages, or the references between its rows, are damaged.
enum result database_check(sqlite3 *db, const char *path, struct error *err);

enum result store_run(struct store *store, const char *sql, struct error *err); // without values
enum result store_failed(struct store *store, int code, struct error *err);

// A statement of a literal, ready for values: "store_prepare(store, sql, "ti", name, id)", where t
// is a text (NULL: none), i an int64_t and r a double (not finite: none). The caller resets it.
enum result store_prepare(struct store *store, const char *sql, sqlite3_stmt **out,
                          struct error *err, const char *kinds, ...);
// The same, and runs it to its end.
enum result store_do(struct store *store, const char *sql, struct error *err, const char *kinds,
                     ...);
// The first column of the first row. RESULT_MISSING, without a text in err, if there is no row.
enum result store_find(struct store *store, const char *sql, int64_t *out, struct error *err,
                       const char *kinds, ...);

// Calls `take` for each row of a prepared statement, and resets the statement.
enum result store_each_row(struct store *store, sqlite3_stmt *statement, store_row_handler take,
                           void *user, struct error *err);

// The number of a new row: the next one, or where servers share the records the next one that is
// this server's. `last`: SQL of the last number that was given.
#define STORE_NUMBER_BEHIND(last)                                                                  \
    "(SELECT last + 1 + (step + slot - (last + 1) % step) % step FROM share, "                     \
    "(SELECT ifnull((" last "), 0) AS last))"
#define STORE_NEXT(table)                                                                          \
    STORE_NUMBER_BEHIND("SELECT number FROM last_number WHERE kind = '" table "'")
// Of a table with AUTOINCREMENT.
#define STORE_NEXT_AUTO(table)                                                                     \
    STORE_NUMBER_BEHIND("SELECT seq FROM sqlite_sequence WHERE name = '" table "'")
// Where several servers may make a row at the same time, it gets the same number at each:
// number_of(TEXT).

// Ends the transaction that store_begin began: commits if `result` is RESULT_OK, else rolls back.
// Returns `result`, or the error of the commit.
enum result store_end(struct store *store, enum result result, struct error *err);
enum result store_begin(struct store *store, struct error *err);

// The sessions, and the exams, whose trainee's name an account, which rates them, does not learn.
#define STORE_BLIND_EXAMS(account)                                                                 \
    "(SELECT blind.exam_id FROM exam_rater blind JOIN exam be ON be.id = blind.exam_id "           \
    "JOIN account ba ON ba.id = blind.account_id "                                                 \
    "WHERE be.state <> 'released' AND ba.name = " account ")"
#define STORE_BLIND_SESSIONS(account)                                                              \
    "(SELECT bt.session_id FROM attempt bt JOIN exam_task bx ON bx.attempt_id = bt.id "            \
    "WHERE bx.exam_id IN " STORE_BLIND_EXAMS(account) ")"

// The columns of LIST_ATTEMPTS, of attempts `a` and their sessions `s`.
#define STORE_ATTEMPTS                                                                             \
    "SELECT s.uuid AS session, a.number, station.name AS station, trainee.name AS trainee, "       \
    "trainee.id AS trainee_number, a.task, a.task_version, a.title, a.file_hash, knee_case.name "  \
    "AS \"case\", "                                                                                \
    "knee_case.hash AS case_hash, a.purpose, a.hand, a.first_step, a.last_step, a.begun_utc_ns, "  \
    "a.time_s, a.goals, a.goals_met, a.errors, a.sentinel, a.verdict, a.end, a.pass_time_s, "      \
    "a.pass_errors, a.mark_version, exam.id AS exam, exam.state AS exam_state, a.figures, "        \
    "a.occurrences FROM attempt a JOIN session s ON s.id = a.session_id "                          \
    "JOIN station ON station.id = s.station_id JOIN knee_case ON knee_case.id = s.case_id "        \
    "LEFT JOIN trainee ON trainee.id = s.trainee_id "                                              \
    "LEFT JOIN exam_task x ON x.attempt_id = a.id LEFT JOIN exam ON exam.id = x.exam_id "

// Whether an attempt `a` says something of its trainee: nobody else ended it, and it ran.
#define STORE_ATTEMPT_COUNTS "(a.end <> 'stopped' AND a.time_s > 0)"

// The columns of LIST_EXAMS, of exams `e`.
#define STORE_EXAMS                                                                                \
    "SELECT e.id, course.name AS course, trainee.name AS trainee, e.title, e.state, e.seed, "      \
    "e.created_utc_ns, e.begun_utc_ns, e.released_utc_ns, e.who, e.station_check, e.case_hash, "   \
    "e.drift_mm, e.verdict, e.result, e.result_hash, e.certificate, e.signature, "                 \
    "(SELECT count(*) FROM intervention i WHERE i.exam_id = e.id) AS interventions FROM exam e "   \
    "JOIN trainee ON trainee.id = e.trainee_id LEFT JOIN course ON course.id = e.course_id "

// The columns of LIST_RATINGS, of ratings `r`, attempts `a` and sessions `s`.
#define STORE_RATINGS                                                                              \
    "SELECT s.uuid AS session, a.number, account.name AS rater, r.utc_ns, r.safety, "              \
    "r.field_of_view, r.camera_dexterity, r.instrument_dexterity, r.bimanual_dexterity, r.flow, "  \
    "r.quality, r.autonomy, r.remark FROM rating r JOIN attempt a ON a.id = r.attempt_id "         \
    "JOIN session s ON s.id = a.session_id LEFT JOIN account ON account.id = r.account_id "

// A table whose rows have unique names.
struct named_table {
    const char *name, *with_article; // "trainee", "a trainee": for errors and the audit log
    const char *find, *rename;       // SQL
};
extern const struct named_table account_table, course_table, trainee_table;
extern const struct named_table present_trainee_table; // without those who were erased

// The number of the row with this name.
enum result store_find_named(struct store *store, const struct named_table *table, const char *name,
                             int64_t *out_id, struct error *err);
// Begins a transaction and finds the row with this name. After an error no transaction is open.
enum result store_begin_named(struct store *store, const struct named_table *table,
                              const char *name, int64_t *out_id, struct error *err);

// RESULT_REFUSED if a row has that name already.
enum result store_must_be_new(struct store *store, const struct named_table *table,
                              const char *name, struct error *err);
// Inside a transaction: the row gets the name, unless another one has it, and the audit log an
// entry.
enum result store_rename_row(struct store *store, const struct named_table *table, int64_t id,
                             const char *new_name, struct error *err);

// Like store_end, after an INSERT of a `kind`, which it adds to the audit log.
enum result store_end_added(struct store *store, enum result result, const char *kind,
                            struct error *err);

// Adds an entry about "kind id" to the audit log, or about "kind" if id is 0.
enum result store_audit(struct store *store, const char *action, const char *kind, int64_t id,
                        struct error *err);

// Functions that the statements of this room call.
enum result store_add_functions(struct store *store, struct error *err);

// RESULT_INVALID if argon2 has not encoded it.
enum result store_check_password(const char *password, struct error *err);
