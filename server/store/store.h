// The records: trainees, stations, cases, sessions and their results, in an SQLite database (WAL).
// The full record of a session is its trace. docs/RECORDS.md describes the tables and names the
// personal data.
//
// A store belongs to the thread that opened it. Open it for a moment only: store_restore waits
// until nobody has the file open. Any number of programs may open the same file.
//
// Errors name the file and what to do. After an error the records are unchanged.
// RESULT_TIMEOUT: another program locked the file; try again.  RESULT_CORRUPT: the file is damaged.
// RESULT_FORMAT: the file is something else.  RESULT_VERSION: a newer program made it.
// RESULT_IO: the disk, or the file's permissions.  RESULT_INVALID: a text is too long, empty or not
// printable.  RESULT_REFUSED: the change contradicts the records.  RESULT_MISSING: the records have
// nothing of that name.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

#define STORE_NAME_MAX 64 // bytes of UTF-8 with the 0 at the end
#define STORE_TEXT_MAX 256
#define STORE_ID_MAX 33   // 32 hexadecimal digits
#define STORE_HASH_MAX 65 // a SHA-256 in hexadecimal digits

struct store;

enum store_mode {
    STORE_THERE, // RESULT_MISSING if the file does not exist
    STORE_MAKE   // makes a missing file, for this user alone
};

// Upgrades an older database to this version's tables, each step completely or not at all.
// actor: for the audit log; copied.
enum result store_open(const char *path, enum store_mode mode, const char *actor,
                       struct store **out_store, struct error *err);
void store_close(struct store **store); // NULL inside is fine

// Sets the actor of the following changes; copied.
void store_set_actor(struct store *store, const char *actor);

// Adds an entry to the audit log about something outside the records: subject "station room-1". It
// must not contain personal data, because nobody can change an entry.
enum result store_note(struct store *store, const char *action, const char *subject,
                       struct error *err);

struct store_principal; // below

// ---- people and courses -------------------------------------------------------------------------

// full_name may be NULL. RESULT_REFUSED where the name is taken.
enum result store_add_trainee(struct store *store, const char *name, const char *full_name,
                              struct error *err);
enum result store_add_course(struct store *store, const char *name, struct error *err);

// A trainee may be in several courses. Enrolling twice in one course is no error.
enum result store_enrol(struct store *store, const char *trainee, const char *course,
                        struct error *err);
enum result store_unenrol(struct store *store, const char *trainee, const char *course,
                          struct error *err);

// NULL leaves the name or the full name unchanged; an empty full_name removes it. RESULT_REFUSED if
// the new name is taken.
enum result store_change_trainee(struct store *store, const char *name, const char *new_name,
                                 const char *full_name, struct error *err);
enum result store_rename_course(struct store *store, const char *name, const char *new_name,
                                struct error *err);

// Removes a trainee with courses, accounts and tokens. RESULT_REFUSED if the trainee has sessions:
// erase the trainee instead. The trainees of a removed course stay.
enum result store_remove_trainee(struct store *store, const char *name, struct error *err);
enum result store_remove_course(struct store *store, const char *name, struct error *err);

enum store_role { ROLE_TECHNICIAN, ROLE_INSTRUCTOR, ROLE_TRAINEE, ROLE_COUNT };

const char *store_role_name(enum store_role role); // "technician", "instructor", "trainee"
bool store_role_from_name(const char *name, enum store_role *out_role);

// password: as argon2 encoded it ("$argon2id$v=19$..."), or NULL for an account that cannot sign
// in. trainee: the trainee whom the account belongs to, or NULL.
enum result store_add_account(struct store *store, const char *name, enum store_role role,
                              const char *password, const char *trainee, struct error *err);

// These three end all cookies and tokens of the account. RESULT_REFUSED if no instructor who can
// sign in would be left.
enum result store_remove_account(struct store *store, const char *name, struct error *err);
enum result store_set_role(struct store *store, const char *name, enum store_role role,
                           struct error *err);
enum result store_set_password(struct store *store, const char *name, const char *password,
                               struct error *err);

// Like store_set_password, for an account that store_find_account found. RESULT_MISSING if its
// password has changed since then.
enum result store_change_password(struct store *store, const struct store_principal *whose,
                                  const char *password, struct error *err);
enum result store_rename_account(struct store *store, const char *name, const char *new_name,
                                 struct error *err);

// Replaces the trainee's name by a pseudonym (out_pseudonym), deletes the full name, courses,
// accounts, tokens, exams, attempts and their ratings, and overwrites them in the file. Sessions
// and results stay.
enum result store_erase_trainee(struct store *store, const char *name,
                                char out_pseudonym[STORE_NAME_MAX], struct error *err);

// ---- signing in ---------------------------------------------------------------------------------

enum store_token_kind {
    // Of a browser: ends 12 h after its last use, and a week after the sign-in. After a sign-in
    // with a code it also ends with that code, or when the trainee gets a new code.
    TOKEN_COOKIE,
    TOKEN_BEARER, // of a program: ends after a year
    TOKEN_CODE,   // signs a trainee in, any number of times, for 12 h
    TOKEN_COUNT
};

// A person or program that has signed in, or may do so with the right password.
struct store_principal {
    char name[STORE_NAME_MAX]; // of the account, or of the trainee who uses a code
    enum store_role role;
    char trainee[STORE_NAME_MAX];  // the trainee whose sessions the principal owns; may be empty
    char actor[STORE_NAME_MAX];    // for the audit log: a trainee by number, staff by name
    char password[STORE_TEXT_MAX]; // encoded, of an account; empty: it cannot sign in
    bool by_account;               // false: by a trainee's code
    int64_t number;                // of the account, or of the trainee who uses a code
    int64_t token;                 // number of the token or code that was looked up; else 0
    int64_t entry;                 // the last of the audit log when it was looked up
};

enum result store_find_account(struct store *store, const char *name,
                               struct store_principal *out_principal, struct error *err);

// The owner of a cookie or token. Records its use every few minutes. RESULT_MISSING if there is no
// such token, or it has ended.
enum result store_find_token(struct store *store, const char *hash,
                             struct store_principal *out_principal, struct error *err);
// The trainee of a code, as a principal without account.
enum result store_find_code(struct store *store, const char *hash,
                            struct store_principal *out_principal, struct error *err);

// Adds a cookie or token for a principal that a function above found, or a code for a trainee. Only
// the hash is kept. name: the owner's name for it, or NULL. *out_until_utc_ns: when it ends.
//
// RESULT_MISSING if the owner's password has changed since then, or the token or code has ended. An
// owner keeps the newest 32 cookies. More than 32 tokens are RESULT_LIMIT. A new code ends the
// previous code and its cookies.
enum result store_add_token(struct store *store, enum store_token_kind kind, const char *hash,
                            const struct store_principal *owner, const char *name, int64_t *out_id,
                            int64_t *out_until_utc_ns, struct error *err);
enum result store_add_code(struct store *store, const char *trainee, const char *hash,
                           int64_t *out_until_utc_ns, struct error *err);

// RESULT_MISSING if it is not this owner's.
enum result store_remove_token(struct store *store, const struct store_principal *owner, int64_t id,
                               struct error *err);

// Ends all cookies and tokens of the principal's account, or all cookies of the trainee's code.
enum result store_sign_out(struct store *store, const struct store_principal *whose,
                           struct error *err);
// Ends all cookies and tokens of an account; all those of a trainee's accounts, and the code.
enum result store_sign_out_account(struct store *store, const char *name, struct error *err);
enum result store_sign_out_trainee(struct store *store, const char *trainee, struct error *err);

// Whether there is an instructor who can sign in.
enum result store_has_instructor(struct store *store, bool *out_has, struct error *err);

// ---- sessions -----------------------------------------------------------------------------------

enum store_state {
    STATE_OPEN,
    STATE_CLOSED,
    STATE_DESERTED,   // its station stayed away for too long
    STATE_INTERRUPTED // its server ended before it did
};

struct store_session {
    char id[STORE_ID_MAX]; // lower-case hexadecimal
    char station[STORE_NAME_MAX];
    char trainee[STORE_NAME_MAX]; // empty: nobody was named
    char case_name[STORE_NAME_MAX];
    uint64_t case_hash;
    int64_t start_utc_ns;
    int64_t end_utc_ns; // 0: not yet
    enum store_state state;
    uint64_t steps;
    uint64_t missing; // steps that its trace lacks
    char trace[STORE_TEXT_MAX];
    int part; // of the session's trace that this one is, from 1
    bool trace_is_read;
    uint64_t trace_xxh3; // of the whole file, where it was read
    char trace_hash[65]; // of its last record (trace/FORMAT.md), hexadecimal; empty: none
};

// One figure of a session. Figures of different versions of a metric stand beside each other.
struct store_result {
    char metric[STORE_NAME_MAX];  // "resection.over"
    char subject[STORE_NAME_MAX]; // of what: a tissue, an instrument; empty: the session
    int version;                  // of the metric's definition, from 1
    char unit[16];                // "mm3"; empty: a number
    double value;                 // not finite: none
    char details[STORE_TEXT_MAX]; // a JSON object, or empty
};

// Writes the current state of a session together with its results. Adds a new station, trainee or
// case. A session that exists keeps its station, trainee, case and start; a deserted one stays
// deserted. Its state and results are those of its last part: of an earlier one only the place of
// its trace is kept.
enum result store_put_session(struct store *store, const struct store_session *session,
                              const struct store_result *results, int count, struct error *err);

// The same for a session that has ended. RESULT_MISSING if the records lack it and its trace is
// gone too: then somebody has removed it.
enum result store_put_ended(struct store *store, const struct store_session *session,
                            const struct store_result *results, int count, struct error *err);

// Deletes a session, its results, its attempts and its trace. RESULT_REFUSED while the session is
// open, or a server writes its trace.
enum result store_remove_session(struct store *store, const char *id, struct error *err);
// The same, unless the session is not dispensable (RESULT_REFUSED).
enum result store_remove_dispensable(struct store *store, const char *id, struct error *err);

// Marks open sessions that began before this time as interrupted: their server has ended.
enum result store_interrupt_open(struct store *store, int64_t before_utc_ns, struct error *err);

// Whether the records have everything of the session with this trace (the path as it was put).
enum result store_trace_is_done(struct store *store, const char *trace, bool *out_done,
                                struct error *err);

// ---- audit --------------------------------------------------------------------------------------

// An action on something outside these tables. `action` and `subject` contain no personal data,
// because nobody can change an entry.
struct store_audit_entry {
    int64_t utc_ns;
    char actor[STORE_NAME_MAX];
    char action[STORE_NAME_MAX];
    char subject[STORE_TEXT_MAX];
};

enum result store_put_audit(struct store *store, const struct store_audit_entry *entry,
                            struct error *err);

// Each entry has a SHA-256 over itself and the hash of the entry before it. So an entry and its
// hash stand for all entries up to it. Of servers that share the records (share.h) each has a chain
// of its own: these functions are about this server's, and store_verify_audit looks at all.
struct store_audit_head {
    int64_t entry; // its number, from 1; 0: there is none
    char hash[STORE_HASH_MAX];
};

// The last entry.
enum result store_audit_head(struct store *store, struct store_audit_head *out_head,
                             struct error *err);
// RESULT_MISSING if the log has no such entry with this hash.
enum result store_audit_has(struct store *store, const struct store_audit_head *head,
                            struct error *err);
// Calculates all hashes again. RESULT_CORRUPT names the first entry that is missing or was changed.
enum result store_verify_audit(struct store *store, struct store_audit_head *out_head,
                               struct error *err);

// What a server signed last; certificate and signature (DER) in hexadecimal digits.
#define STORE_CERTIFICATE_MAX 4097
#define STORE_SIGNATURE_MAX 257
struct store_audit_seal {
    struct store_audit_head head;
    int64_t utc_ns;
    char certificate[STORE_CERTIFICATE_MAX], signature[STORE_SIGNATURE_MAX];
};

// Replaces the previous seal.
enum result store_put_audit_seal(struct store *store, const struct store_audit_seal *seal,
                                 struct error *err);
// RESULT_MISSING if no server has signed the log.
enum result store_audit_seal(struct store *store, struct store_audit_seal *out_seal,
                             struct error *err);

// ---- reading ------------------------------------------------------------------------------------

enum store_list {
    LIST_TRAINEES,
    LIST_COURSES,
    LIST_ENROLMENTS,
    LIST_STATIONS,
    LIST_CASES,
    LIST_SESSIONS,
    LIST_PARTS,   // of a session: those that other parts of its trace follow
    LIST_RESULTS, // of a session
    LIST_ACCOUNTS,
    LIST_TOKENS, // of an account or trainee; without hashes
    LIST_AUDIT,
    LIST_ATTEMPTS,   // of a session
    LIST_CURRICULA,  // of a course: the tasks of all versions
    LIST_MARKS,      // of a task
    LIST_EXAMS,      // by number
    LIST_EXAM_TASKS, // these three by the exam's number
    LIST_EXAM_RATERS,
    LIST_INTERVENTIONS,
    LIST_RATINGS, // of a session's attempts
    LIST_COUNT
};

const char *store_list_name(enum store_list list); // "trainees", "courses", ...
bool store_list_from_name(const char *name, enum store_list *out_list);

enum store_kind { STORE_NULL, STORE_INTEGER, STORE_REAL, STORE_TEXT };

struct store_cell {
    const char *column;
    enum store_kind kind;
    int64_t integer;
    double real;
    const char *text; // STORE_TEXT
};

typedef void (*store_row_handler)(void *user, const struct store_cell *cells, int count);

// The sessions of this server that nobody would miss for a judgement: no open ones, none with a
// rating or an attempt of an exam, none whose trace has not been read yet, none of several parts.
// As rows with uuid, trace and end_utc_ns, the oldest end first.
enum result store_dispensable(struct store *store, store_row_handler take, void *user,
                              struct error *err);

// The traces of open sessions, as a row with the column "trace".
enum result store_open_traces(struct store *store, store_row_handler take, void *user,
                              struct error *err);

// Calls `take` for each row, in the order in which they were made. Texts live until it returns.
// key: a name or id (for results: of their session), or NULL for all rows.
enum result store_rows(struct store *store, enum store_list list, const char *key,
                       store_row_handler take, void *user, struct error *err);

// The columns of a list, without rows.
enum result store_columns(struct store *store, enum store_list list, store_row_handler take,
                          void *user, struct error *err);

// The sessions of one trainee, as LIST_SESSIONS.
enum result store_sessions_of(struct store *store, const char *trainee, store_row_handler take,
                              void *user, struct error *err);

// A NULL field matches every session.
struct store_filter {
    const char *trainee, *course, *case_name; // course: of its trainees
    const char *before; // only those that began before this session (of `trainee`, if given)
    int limit;
    // A rater, who finds nothing by the name of a trainee that it must not learn; NULL: nobody.
    const char *rater;
};

// Newest first, as LIST_SESSIONS.
enum result store_find_sessions(struct store *store, const struct store_filter *filter,
                                store_row_handler take, void *user, struct error *err);

// The last rows of the audit log, newest first, as LIST_AUDIT.
enum result store_last_audit(struct store *store, int limit, store_row_handler take, void *user,
                             struct error *err);

// In a smaller group a trainee could tell whose figures the others' are.
#define STORE_TRAINEES_MIN 5

// The figures of all closed sessions on a case, of the trainees of a course (NULL: of all
// trainees): metric, subject, version, unit and value, sorted in this order. Leaves out figures
// without a value.
//
// hide_few: for a trainee. Leaves out a metric, subject, version and unit of fewer than
// STORE_TRAINEES_MIN trainees. Of the others it gives averages (microaggregation): it divides the
// sorted figures into groups of at least STORE_TRAINEES_MIN trainees, and replaces each figure by
// the mean of its group. It rounds the means to a tenth of the range, up to 1, 2 or 5 times a power
// of ten. So neither a figure nor the change by a session tells what somebody else achieved.
enum result store_figures_on(struct store *store, const char *case_name, const char *course,
                             bool hide_few, store_row_handler take, void *user, struct error *err);

// name and full_name of a course's trainees; name of a trainee's courses.
enum result store_trainees_in(struct store *store, const char *course, store_row_handler take,
                              void *user, struct error *err);
enum result store_courses_of(struct store *store, const char *trainee, store_row_handler take,
                             void *user, struct error *err);

// ---- the whole file -----------------------------------------------------------------------------

// Copies the records as they are at one moment into a new file of this user alone, and checks the
// copy. Others may write meanwhile. RESULT_REFUSED if the file exists. An error about missing space
// names the file that needs it.
enum result store_backup(struct store *store, const char *out_path, struct error *err);

// Identifies the file of the records. The inode alone does not: a file system reuses it, and
// somebody may copy a backup over the file. But the audit log only grows.
struct store_identity {
    uint64_t device, inode; // inode 0: there was no file
    int64_t changed_ns;     // ctime of the file
    int64_t audit;          // the number of the last entry
    int64_t dropped;        // changes of this server that contradicted others' (share.h)
};

// before: the last known identity, or all zero. Does not open a file that has not changed since.
enum result store_identify(const char *path, const struct store_identity *before,
                           struct store_identity *out, struct error *err);
// Whether somebody replaced the file, or something that this server had written was dropped.
bool store_is_other(const struct store_identity *before, const struct store_identity *now);

// Replaces the records at `path` by a backup, in one step, after it has checked the backup. Keeps
// the replaced file beside it; its path is in out_aside (empty: there was none). Waits until nobody
// has the records open.
enum result store_restore(const char *backup, const char *path, const char *actor,
                          char out_aside[STORE_TEXT_MAX], struct error *err);
