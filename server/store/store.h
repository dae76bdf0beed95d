// The records: who trained where, on what, and with which results. An SQLite database (WAL) that is
// made from what happened; the truth about a session stays in its trace. docs/RECORDS.md has the
// tables, and what of them is personal.
//
// A store belongs to the thread that opened it, and is meant to be open for a moment only: whoever
// has it open keeps store_restore waiting. Any number of programs may have the same file open.
//
// Errors name the file and what to do. RESULT_TIMEOUT: another program kept it locked, all can be
// tried again. RESULT_CORRUPT: it is damaged. RESULT_FORMAT: it is something else. RESULT_VERSION:
// a newer program made it. RESULT_IO: the disk or its rights. RESULT_INVALID: a text that is too
// long, empty or unprintable. RESULT_REFUSED: it contradicts what is there. RESULT_MISSING: nothing
// of that name. After any of them the records are as they were.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

#define STORE_NAME_MAX 64 // bytes of UTF-8 with the 0 at the end
#define STORE_TEXT_MAX 256
#define STORE_ID_MAX 33 // 32 hexadecimal digits

struct store;

enum store_mode {
    STORE_THERE, // RESULT_MISSING where the file is not there
    STORE_MAKE   // made where it is not there, for this user alone
};

// Brings an older database to this version's tables: forwards only, each step whole or not at all.
// actor: who this is, for the audit log; copied.
enum result store_open(const char *path, enum store_mode mode, const char *actor,
                       struct store **out_store, struct error *err);
void store_close(struct store **store); // NULL inside is fine

// From now on somebody else does it; copied.
void store_set_actor(struct store *store, const char *actor);

// A line of the audit log about what is not in the records: subject "station room-1". No personal
// data, for the line is never changed.
enum result store_note(struct store *store, const char *action, const char *subject,
                       struct error *err);

struct store_principal; // who comes in, below

// ---- people and courses -------------------------------------------------------------------------

// full_name may be NULL. RESULT_REFUSED where the name is taken.
enum result store_add_trainee(struct store *store, const char *name, const char *full_name,
                              struct error *err);
enum result store_add_course(struct store *store, const char *name, struct error *err);

// A trainee may be in several courses; once more in the same one is fine.
enum result store_enrol(struct store *store, const char *trainee, const char *course,
                        struct error *err);
enum result store_unenrol(struct store *store, const char *trainee, const char *course,
                          struct error *err);

// Each of new_name and full_name may be NULL: it stays; an empty full_name is taken away.
// RESULT_REFUSED where the new name is taken.
enum result store_change_trainee(struct store *store, const char *name, const char *new_name,
                                 const char *full_name, struct error *err);
enum result store_rename_course(struct store *store, const char *name, const char *new_name,
                                struct error *err);

// A trainee with courses, accounts and tokens: RESULT_REFUSED where there are sessions, whose
// trainee can only be erased. A course: its trainees stay.
enum result store_remove_trainee(struct store *store, const char *name, struct error *err);
enum result store_remove_course(struct store *store, const char *name, struct error *err);

enum store_role { ROLE_TECHNICIAN, ROLE_INSTRUCTOR, ROLE_TRAINEE, ROLE_COUNT };

const char *store_role_name(enum store_role role); // "technician", "instructor", "trainee"
bool store_role_from_name(const char *name, enum store_role *out_role);

// password: encoded by argon2 ("$argon2id$v=19$..."), never the password itself, or NULL for an
// account that cannot log in. trainee: whose account it is, or NULL.
enum result store_add_account(struct store *store, const char *name, enum store_role role,
                              const char *password, const char *trainee, struct error *err);

// Of an instructor who can sign in one stays, else RESULT_REFUSED. Both end all that the account is
// signed in by; so does a new password.
enum result store_remove_account(struct store *store, const char *name, struct error *err);
enum result store_set_role(struct store *store, const char *name, enum store_role role,
                           struct error *err);
enum result store_set_password(struct store *store, const char *name, const char *password,
                               struct error *err);

// For an account as store_find_account found it: RESULT_MISSING where it has another password now.
enum result store_change_password(struct store *store, const struct store_principal *whose,
                                  const char *password, struct error *err);
enum result store_rename_account(struct store *store, const char *name, const char *new_name,
                                 struct error *err);

// Takes away who the trainee was: name and full name give way to a pseudonym (written to
// out_pseudonym), their courses, accounts and tokens go, and nothing of them stays in the file.
// Their sessions and results stay. RESULT_MISSING where there is none of that name.
enum result store_erase_trainee(struct store *store, const char *name,
                                char out_pseudonym[STORE_NAME_MAX], struct error *err);

// ---- who comes in -------------------------------------------------------------------------------

#define STORE_HASH_MAX 65 // a SHA-256 in hexadecimal digits

enum store_token_kind {
    // Of a browser: ends 12 h after it was last used, and a week after it began; of a trainee who
    // came in by a code, with that code too, or when there is a new one.
    TOKEN_COOKIE,
    TOKEN_BEARER, // of a program: ends after a year
    TOKEN_CODE,   // signs a trainee in, any number of times, for 12 h
    TOKEN_COUNT
};

// Who has signed in, or would with the right password.
struct store_principal {
    char name[STORE_NAME_MAX]; // of the account; of the trainee where a code was enough
    enum store_role role;
    char trainee[STORE_NAME_MAX];  // whose sessions are theirs; empty: nobody's
    char actor[STORE_NAME_MAX];    // for the audit log: a trainee by number, staff by name
    char password[STORE_TEXT_MAX]; // as it was put, empty: cannot sign in; of store_find_account
    bool by_account;               // and not by a trainee's code
    int64_t token;                 // of store_find_token its number, of store_find_code the code's
};

enum result store_find_account(struct store *store, const char *name,
                               struct store_principal *out_principal, struct error *err);

// Who has this cookie or token, whose use is noted every few minutes. RESULT_MISSING where it is
// nobody's, or has ended.
enum result store_find_token(struct store *store, const char *hash,
                             struct store_principal *out_principal, struct error *err);
// The trainee of a code, as a visitor without account.
enum result store_find_code(struct store *store, const char *hash,
                            struct store_principal *out_principal, struct error *err);

// Keeps a new one of a visitor who was found above; of a code that of the trainee of that name.
// name: what its owner calls it, or NULL. The hash is of what is never kept itself. Of cookies the
// oldest of more than 32 go, a new code voids the one before, more than 32 tokens are refused
// (RESULT_LIMIT). *out_until_utc_ns: when it ends. RESULT_MISSING where the visitor has another
// password by now, or what they were found by has ended.
enum result store_add_token(struct store *store, enum store_token_kind kind, const char *hash,
                            const struct store_principal *owner, const char *name, int64_t *out_id,
                            int64_t *out_until_utc_ns, struct error *err);
enum result store_add_code(struct store *store, const char *trainee, const char *hash,
                           int64_t *out_until_utc_ns, struct error *err);

// RESULT_MISSING where it is not this visitor's.
enum result store_remove_token(struct store *store, const struct store_principal *owner, int64_t id,
                               struct error *err);

// Ends all that this visitor's account is signed in by, or all that came in by the trainee's code.
enum result store_sign_out(struct store *store, const struct store_principal *whose,
                           struct error *err);
// All that an account is signed in by; of a trainee that of their accounts, too, and the code.
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

// Writes what is now known of a session, and results with it: all or nothing. Station, trainee and
// case are made where they are new. A session that is there keeps what it began with, and stays
// deserted.
enum result store_put_session(struct store *store, const struct store_session *session,
                              const struct store_result *results, int count, struct error *err);

// Takes a session and its results away, and then its trace, from which it would come again.
// RESULT_REFUSED while it is open.
enum result store_remove_session(struct store *store, const char *id, struct error *err);

// Sessions that are open although they began before this time: their server has ended.
enum result store_interrupt_open(struct store *store, int64_t before_utc_ns, struct error *err);

// Whether all is known of the session with this trace (its path as it was put).
enum result store_trace_is_done(struct store *store, const char *trace, bool *out_done,
                                struct error *err);

// ---- audit --------------------------------------------------------------------------------------

// What somebody did to something that is not in these tables, without personal data in `action` and
// `subject`: the log is never changed.
struct store_audit_entry {
    int64_t utc_ns;
    char actor[STORE_NAME_MAX];
    char action[STORE_NAME_MAX];
    char subject[STORE_TEXT_MAX];
};

enum result store_put_audit(struct store *store, const struct store_audit_entry *entry,
                            struct error *err);

// ---- reading ------------------------------------------------------------------------------------

enum store_list {
    LIST_TRAINEES,
    LIST_COURSES,
    LIST_ENROLMENTS,
    LIST_STATIONS,
    LIST_CASES,
    LIST_SESSIONS,
    LIST_RESULTS, // of a session
    LIST_ACCOUNTS,
    LIST_TOKENS, // of an account or trainee; without hashes
    LIST_AUDIT,
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

// Gives each row to the taker, in the order in which they were made; texts live until it returns.
// key: only the rows of this name or id (results: of this session), or NULL for all.
enum result store_rows(struct store *store, enum store_list list, const char *key,
                       store_row_handler take, void *user, struct error *err);

// The columns of a list, without rows.
enum result store_columns(struct store *store, enum store_list list, store_row_handler take,
                          void *user, struct error *err);

// The sessions of one trainee, as LIST_SESSIONS.
enum result store_sessions_of(struct store *store, const char *trainee, store_row_handler take,
                              void *user, struct error *err);

// Which sessions; NULL: any.
struct store_filter {
    const char *trainee, *course, *case_name; // course: of its trainees
    const char *before;                       // only those that began before this session
    int limit;
};

// Newest first, as LIST_SESSIONS.
enum result store_find_sessions(struct store *store, const struct store_filter *filter,
                                store_row_handler take, void *user, struct error *err);

// The last rows of the audit log, newest first, as LIST_AUDIT.
enum result store_last_audit(struct store *store, int limit, store_row_handler take, void *user,
                             struct error *err);

// Of fewer trainees, one of them could tell whose the others' figures are.
#define STORE_TRAINEES_TOLD 5

// The figures of all sessions on a case that were closed as they should, of the trainees of a
// course (NULL: of all): metric, subject, version, unit and value, in this order and rising,
// without a name. Those that have no value are left out. few_untold: so are those of a metric,
// subject, version and unit that fewer than STORE_TRAINEES_TOLD trainees have, however many
// sessions.
enum result store_figures_on(struct store *store, const char *case_name, const char *course,
                             bool few_untold, store_row_handler take, void *user,
                             struct error *err);

// name and full_name of a course's trainees; name of a trainee's courses.
enum result store_trainees_in(struct store *store, const char *course, store_row_handler take,
                              void *user, struct error *err);
enum result store_courses_of(struct store *store, const char *trainee, store_row_handler take,
                             void *user, struct error *err);

// ---- the whole file -----------------------------------------------------------------------------

// A copy of the records at one moment, checked, in a new file of this user alone; others may write
// meanwhile. RESULT_REFUSED where the file is there.
enum result store_backup(struct store *store, const char *out_path, struct error *err);

// Which file the records are. A file system gives the number of a file that was removed to the next
// one, and bytes can be copied over it: but the audit log only grows.
struct store_identity {
    uint64_t device, inode; // inode 0: there was no file
    int64_t changed_ns;     // the file
    int64_t audit;          // the number of the last entry
};

// before: as it was known, or all zero; a file that has not changed since then is not opened.
enum result store_identify(const char *path, const struct store_identity *before,
                           struct store_identity *out, struct error *err);
// Whether somebody put another file in its place.
bool store_is_other(const struct store_identity *before, const struct store_identity *now);

// Puts a backup in the place of the records at `path`, at once or not at all; what was there is
// kept beside it, its path in out_aside (empty: nothing was there). Waits until nobody has them
// open.
enum result store_restore(const char *backup, const char *path, const char *actor,
                          char out_aside[STORE_TEXT_MAX], struct error *err);
