#include "base/check.h"
#include "base/clock.h"
#include "store/database.h"
#include "store/text.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#define OWN "server = (SELECT server FROM share)" // its trace is this server's

static const char *const session_state_names[] = {"open", "closed", "deserted", "interrupted"};

static enum result check_session(const struct store_session *s, struct error *err) {
    enum result result = text_check(s->station, "session's station", sizeof s->station, err);
    if (result == RESULT_OK)
        result = text_check(s->case_name, "session's case", sizeof s->case_name, err);
    if (result == RESULT_OK && s->trainee[0])
        result = text_check(s->trainee, "session's trainee", sizeof s->trainee, err);
    if (result == RESULT_OK)
        result = text_check(s->trace, "session's trace", sizeof s->trace, err);
    if (result == RESULT_OK &&
        (strlen(s->id) != STORE_ID_MAX - 1 || strspn(s->id, "0123456789abcdef") != strlen(s->id)))
        result = fail(err, RESULT_INVALID,
                      "the session's id '%.40s' does not consist of 32 hexadecimal digits", s->id);
    if (result == RESULT_OK && (s->steps > INT64_MAX || s->missing > INT64_MAX))
        result = fail(err, RESULT_INVALID, "the session's steps are out of range");
    return result;
}

static enum result check_result(const struct store_result *r, struct error *err) {
    enum result result = text_check(r->metric, "result's metric", sizeof r->metric, err);
    if (result == RESULT_OK && r->subject[0])
        result = text_check(r->subject, "result's subject", sizeof r->subject, err);
    if (result == RESULT_OK && r->unit[0])
        result = text_check(r->unit, "result's unit", sizeof r->unit, err);
    if (result == RESULT_OK && r->version < 1)
        result = fail(err, RESULT_INVALID, "the result's version is %d", r->version);
    return result;
}

// ---- what it refers to --------------------------------------------------------------------------

static enum result make_places(struct store *store, const struct store_session *s,
                               const char *case_hash, struct error *err) {
    enum result result =
        store_do(store, "INSERT OR IGNORE INTO station (id, name) VALUES (number_of(?1), ?1)", err,
                 "t", s->station);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT OR IGNORE INTO knee_case (id, name, hash) "
                          "VALUES (number_of(?1 || ?2), ?1, ?2)",
                          err, "tt", s->case_name, case_hash);
    if (result == RESULT_OK && s->trainee[0])
        result = store_do(store,
                          "INSERT OR IGNORE INTO trainee (id, name, created_utc_ns) "
                          "VALUES (" STORE_NEXT("trainee") ", ?, ?)",
                          err, "ti", s->trainee, clock_utc_ns());
    return result;
}

// ---- the session --------------------------------------------------------------------------------

static enum result begin_session(struct store *store, const struct store_session *s,
                                 int64_t *out_id, struct error *err) {
    char case_hash[17];
    snprintf(case_hash, sizeof case_hash, "%016" PRIx64, s->case_hash);
    enum result result = make_places(store, s, case_hash, err);
    if (result == RESULT_OK)
        result = store_do(
            store,
            "INSERT INTO session (id, uuid, station_id, trainee_id, case_id, start_utc_ns, state, "
            "steps, missing, trace, part, server) VALUES (" STORE_NEXT(
                "session") ", ?, (SELECT id FROM station WHERE name = ?), "
                           "(SELECT id FROM trainee WHERE name = ?), "
                           "(SELECT id FROM knee_case WHERE name = ? AND hash = ?), ?, 'open', 0, "
                           "0, ?, ?, "
                           "(SELECT server FROM share))",
            err, "tttttiti", s->id, s->station, s->trainee, s->case_name, case_hash,
            s->start_utc_ns, s->trace, (int64_t)s->part);
    *out_id = sqlite3_last_insert_rowid(store->db);
    return result;
}

static enum result find_session(struct store *store, const struct store_session *s, int64_t *out_id,
                                struct error *err) {
    enum result result =
        store_find(store, "SELECT id FROM session WHERE uuid = ?", out_id, err, "t", s->id);
    return result == RESULT_MISSING ? begin_session(store, s, out_id, err) : result;
}

// Whoever removes a session removes both in one transaction.
static enum result find_ended(struct store *store, const struct store_session *s, int64_t *out_id,
                              struct error *err) {
    enum result result =
        store_find(store, "SELECT id FROM session WHERE uuid = ?", out_id, err, "t", s->id);
    if (result != RESULT_MISSING)
        return result;
    if (access(s->trace, F_OK) && errno == ENOENT)
        return fail(err, RESULT_MISSING, "session %s was removed", s->id);
    return begin_session(store, s, out_id, err);
}

#define HASH_SIZE 17

static const char *file_hash(const struct store_session *s, char out[HASH_SIZE]) {
    snprintf(out, HASH_SIZE, "%016" PRIx64, s->trace_xxh3);
    return s->trace_is_read ? out : NULL;
}

static enum result update_session(struct store *store, int64_t id, const struct store_session *s,
                                  struct error *err) {
    char hash[HASH_SIZE];
    return store_do(store,
                    "UPDATE session SET end_utc_ns = nullif(?, 0), "
                    "state = iif(state = 'deserted', state, ?), steps = ?, "
                    "missing = ?, trace = ?, trace_xxh3 = ?, trace_hash = nullif(?, ''), part = ?, "
                    "server = (SELECT server FROM share) WHERE id = ?",
                    err, "itiitttii", s->end_utc_ns, session_state_names[s->state],
                    (int64_t)s->steps, (int64_t)s->missing, s->trace, file_hash(s, hash),
                    s->trace_hash, (int64_t)s->part, id);
}

// A session of one part has it in its own row alone.
#define PUT_PART                                                                                   \
    "INSERT OR REPLACE INTO part (session_id, number, server, end_utc_ns, state, steps, missing, " \
    "trace, trace_xxh3, trace_hash) "

static enum result put_part(struct store *store, int64_t id, const struct store_session *s,
                            struct error *err) {
    char hash[HASH_SIZE];
    return store_do(store,
                    PUT_PART "VALUES (?, ?, (SELECT server FROM share), nullif(?, 0), ?, ?, ?, ?, "
                             "?, nullif(?, ''))",
                    err, "iiitiittt", id, (int64_t)s->part, s->end_utc_ns,
                    session_state_names[s->state], (int64_t)s->steps, (int64_t)s->missing, s->trace,
                    file_hash(s, hash), s->trace_hash);
}

static enum result leave_part(struct store *store, int64_t id, struct error *err) {
    return store_do(store,
                    PUT_PART "SELECT id, part, server, end_utc_ns, state, steps, missing, trace, "
                             "trace_xxh3, trace_hash FROM session WHERE id = ?",
                    err, "i", id);
}

// What its last part tells is in its row.
static enum result put_in_parts(struct store *store, int64_t id, int part,
                                const struct store_session *s, struct error *err) {
    int64_t has = 0;
    enum result result = store_find(store, "SELECT 1 FROM part WHERE session_id = ? AND number = ?",
                                    &has, err, "ii", id, (int64_t)part);
    if (result == RESULT_MISSING)
        result = leave_part(store, id, err);
    if (result == RESULT_OK)
        result = put_part(store, id, s, err);
    return result;
}

static enum result put_result(struct store *store, int64_t session_id, const struct store_result *r,
                              struct error *err) {
    enum result result = check_result(r, err);
    if (result != RESULT_OK)
        return result;
    return store_do(store,
                    "INSERT OR REPLACE INTO result (session_id, metric, subject, version, unit, "
                    "value, details) VALUES (?, ?, ?, ?, ?, ?, nullif(?, ''))",
                    err, "ittitrt", session_id, r->metric, r->subject, (int64_t)r->version, r->unit,
                    r->value, r->details);
}

typedef enum result (*session_finder)(struct store *store, const struct store_session *s,
                                      int64_t *out_id, struct error *err);

static enum result put_session(struct store *store, session_finder find,
                               const struct store_session *s, const struct store_result *results,
                               int count, struct error *err) {
    int64_t id, part;
    CHECK((unsigned)s->state < sizeof session_state_names / sizeof *session_state_names &&
          s->part > 0);
    enum result result = check_session(s, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find(store, s, &id, err);
    if (result == RESULT_OK)
        result = store_find(store, "SELECT part FROM session WHERE id = ?", &part, err, "i", id);
    if (result == RESULT_OK && (s->part > 1 || part > 1))
        result = put_in_parts(store, id, (int)part, s, err);
    if (result == RESULT_OK && s->part < part)
        return store_end(store, result, err);
    if (result == RESULT_OK)
        result = update_session(store, id, s, err);
    for (int i = 0; i < count && result == RESULT_OK; i++)
        result = put_result(store, id, &results[i], err);
    return store_end(store, result, err);
}

enum result store_put_session(struct store *store, const struct store_session *s,
                              const struct store_result *results, int count, struct error *err) {
    return put_session(store, find_session, s, results, count, err);
}

enum result store_put_ended(struct store *store, const struct store_session *s,
                            const struct store_result *results, int count, struct error *err) {
    return put_session(store, find_ended, s, results, count, err);
}

// ---- removing -----------------------------------------------------------------------------------

struct removal {
    int64_t id;
    char trace[STORE_TEXT_MAX];
};

static enum result find_removal(struct store *store, const char *id, struct removal *out,
                                struct error *err) {
    sqlite3_stmt *statement;
    enum result result =
        store_prepare(store, "SELECT id, trace, state = 'open' FROM session WHERE uuid = ?",
                      &statement, err, "t", id);
    if (result != RESULT_OK)
        return result;
    int code = sqlite3_step(statement);
    if (code == SQLITE_DONE)
        result = fail(err, RESULT_MISSING, "%s: there is no session '%.40s'", store->path, id);
    else if (code != SQLITE_ROW)
        result = store_failed(store, code, err);
    else if (sqlite3_column_int(statement, 2))
        result = fail(err, RESULT_REFUSED, "%s: session %s is still open", store->path, id);
    if (result == RESULT_OK) {
        out->id = sqlite3_column_int64(statement, 0);
        snprintf(out->trace, sizeof out->trace, "%s", sqlite3_column_text(statement, 1));
    }
    sqlite3_reset(statement);
    return result;
}

static enum result remove_rows(struct store *store, const char *id, const struct removal *removal,
                               struct error *err) {
    char subject[STORE_NAME_MAX];
    snprintf(subject, sizeof subject, "session %s", id);
    enum result result =
        store_do(store, "DELETE FROM result WHERE session_id = ?", err, "i", removal->id);
    if (result == RESULT_OK) // and the ratings of them
        result = store_do(store, "DELETE FROM attempt WHERE session_id = ?", err, "i", removal->id);
    if (result == RESULT_OK)
        result = store_do(store, "DELETE FROM session WHERE id = ?", err, "i", removal->id);
    return result == RESULT_OK ? store_note(store, "remove", subject, err) : result;
}

// A server that writes a trace has it locked. -1: there is none.
static enum result lock_trace(const char *id, const char *trace, int *out_fd, struct error *err) {
    *out_fd = open(trace, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (*out_fd < 0 || flock(*out_fd, LOCK_EX | LOCK_NB) == 0)
        return RESULT_OK;
    close(*out_fd);
    return fail(err, RESULT_REFUSED, "the trace of session %s is still being written", id);
}

static enum result remove_trace(const char *id, const char *trace, struct error *err) {
    int fd;
    enum result result = lock_trace(id, trace, &fd, err);
    if (result != RESULT_OK)
        return result;
    if (unlink(trace) && errno != ENOENT)
        result = fail(err, RESULT_IO, "%s: %s", trace, strerror(errno));
    if (fd >= 0)
        close(fd);
    return result;
}

// What somebody has judged is kept, and what other servers have parts of.
#define DISPENSABLE                                                                                \
    "state != 'open' AND part = 1 AND trace_xxh3 IS NOT NULL AND " OWN                             \
    " AND NOT EXISTS (SELECT 1 FROM attempt a WHERE a.session_id = session.id AND (a.purpose = "   \
    "'exam' OR EXISTS (SELECT 1 FROM rating r WHERE r.attempt_id = a.id)))"

enum result store_dispensable(struct store *store, store_row_handler take, void *user,
                              struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT uuid, trace, end_utc_ns, (SELECT max(end_utc_ns) FROM session) FROM session WHERE "
        "end_utc_ns IS NOT NULL AND " DISPENSABLE " ORDER BY end_utc_ns, id",
        &statement, err, "");
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

static enum result check_dispensable(struct store *store, const char *id, struct error *err) {
    int64_t found;
    enum result result = store_find(store, "SELECT 1 FROM session WHERE uuid = ? AND " DISPENSABLE,
                                    &found, err, "t", id);
    return result == RESULT_MISSING
               ? fail(err, RESULT_REFUSED, "%s: session %s is kept", store->path, id)
               : result;
}

static enum result remove_session(struct store *store, const char *id, bool if_dispensable,
                                  struct error *err) {
    struct removal removal;
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find_removal(store, id, &removal, err);
    if (result == RESULT_OK && if_dispensable)
        result = check_dispensable(store, id, err);
    if (result == RESULT_OK)
        result = remove_rows(store, id, &removal, err);
    if (result == RESULT_OK)
        result = remove_trace(id, removal.trace, err);
    return store_end(store, result, err);
}

enum result store_remove_session(struct store *store, const char *id, struct error *err) {
    return remove_session(store, id, false, err);
}

enum result store_remove_dispensable(struct store *store, const char *id, struct error *err) {
    return remove_session(store, id, true, err);
}

enum result store_interrupt_open(struct store *store, int64_t before_utc_ns, struct error *err) {
    return store_do(store,
                    "UPDATE session SET state = 'interrupted' "
                    "WHERE state = 'open' AND start_utc_ns < ? AND " OWN,
                    err, "i", before_utc_ns);
}

enum result store_open_traces(struct store *store, store_row_handler take, void *user,
                              struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store, "SELECT trace FROM session WHERE state = 'open' AND " OWN, &statement, err, "");
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_trace_is_done(struct store *store, const char *trace, bool *out_done,
                                struct error *err) {
    int64_t id;
    enum result result =
        store_find(store,
                   "SELECT 1 FROM session WHERE trace = ?1 AND trace_xxh3 IS NOT NULL AND " OWN
                   " UNION ALL SELECT 1 FROM part WHERE trace = ?1 AND trace_xxh3 IS NOT NULL "
                   "AND " OWN,
                   &id, err, "t", trace);
    *out_done = result == RESULT_OK;
    return result == RESULT_MISSING ? RESULT_OK : result;
}
