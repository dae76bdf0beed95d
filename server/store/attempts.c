#include "store/attempts.h"

#include "store/database.h"
#include "store/text.h"

#include <math.h>
#include <string.h>

// ---- checking -----------------------------------------------------------------------------------

static enum result check_texts(const struct attempt_row *row, struct error *err) {
    enum result result = text_check(row->task, "attempt's task", sizeof row->task, err);
    if (result == RESULT_OK)
        result = text_check(row->title, "attempt's title", sizeof row->title, err);
    if (result == RESULT_OK && (strlen(row->file_hash) != STORE_HASH_MAX - 1 ||
                                strspn(row->file_hash, "0123456789abcdef") != STORE_HASH_MAX - 1))
        result = fail(err, RESULT_INVALID,
                      "the hash of the attempt's task does not consist of 64 hexadecimal digits");
    return result;
}

static enum result check_numbers(const struct attempt_row *row, struct error *err) {
    bool good = row->number > 0 && row->task_version > 0 && row->mark_version >= 0 &&
                row->first_step <= row->last_step && row->last_step <= INT64_MAX &&
                isfinite(row->time_s) && row->time_s >= 0 && isfinite(row->pass_time_s) &&
                row->goals >= 0 && row->goals_met >= 0 && row->goals_met <= row->goals &&
                row->errors >= 0 && row->pass_errors >= 0;
    return good ? RESULT_OK
                : fail(err, RESULT_INVALID, "a number of attempt %d at task '%.*s' is out of range",
                       row->number, ATTEMPT_TASK_MAX, row->task);
}

// A text that SQLite reads as JSON, of the kind.
static enum result check_json(struct store *store, const char *text, const char *kind,
                              const char *what, struct error *err) {
    int64_t good = 0;
    enum result result = store_find(store, "SELECT iif(json_valid(?1), json_type(?1) = ?2, 0)",
                                    &good, err, "tt", text, kind);
    if (result == RESULT_OK && text[0] && !good)
        result = fail(err, RESULT_INVALID, "the attempt's %s are no JSON %s", what, kind);
    return result;
}

// ---- adding -------------------------------------------------------------------------------------

static enum result put_attempt(struct store *store, int64_t session_id,
                               const struct attempt_row *row, struct error *err) {
    return store_do(
        store,
        "INSERT INTO attempt (id, session_id, number, task, task_version, title, file_hash, "
        "purpose, "
        "hand, first_step, last_step, begun_utc_ns, time_s, goals, goals_met, errors, sentinel, "
        "verdict, end, pass_time_s, pass_errors, mark_version, figures, occurrences) VALUES "
        "(" STORE_NEXT(
            "attempt") ", ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
                       "ifnull(nullif(?, ''), '{}'), ifnull(nullif(?, ''), '[]')) "
                       "ON CONFLICT (session_id, number) DO UPDATE SET task = excluded.task, "
                       "task_version = excluded.task_version, title = excluded.title, "
                       "file_hash = excluded.file_hash, purpose = excluded.purpose, hand = "
                       "excluded.hand, "
                       "first_step = excluded.first_step, last_step = excluded.last_step, "
                       "begun_utc_ns = excluded.begun_utc_ns, time_s = excluded.time_s, goals = "
                       "excluded.goals, "
                       "goals_met = excluded.goals_met, errors = excluded.errors, sentinel = "
                       "excluded.sentinel, "
                       "verdict = excluded.verdict, end = excluded.end, pass_time_s = "
                       "excluded.pass_time_s, "
                       "pass_errors = excluded.pass_errors, mark_version = excluded.mark_version, "
                       "figures = excluded.figures, occurrences = excluded.occurrences",
        err,
        "iititttt"
        "iiiriiiittriitt",
        session_id, (int64_t)row->number, row->task, (int64_t)row->task_version, row->title,
        row->file_hash, row->purpose, row->hand, (int64_t)row->first_step, (int64_t)row->last_step,
        row->begun_utc_ns, row->time_s, (int64_t)row->goals, (int64_t)row->goals_met,
        (int64_t)row->errors, (int64_t)row->sentinel, row->verdict, row->end, row->pass_time_s,
        (int64_t)row->pass_errors, (int64_t)row->mark_version, row->figures, row->occurrences);
}

// The place of the attempt in an exam that its trainee has begun: the first that is free.
static enum result join_exam(struct store *store, int64_t session_id, const struct attempt_row *row,
                             struct error *err) {
    int64_t place;
    enum result result = store_find(
        store,
        "SELECT x.rowid FROM exam_task x JOIN exam e ON e.id = x.exam_id "
        "JOIN session s ON s.trainee_id = e.trainee_id JOIN knee_case c ON c.id = s.case_id "
        "WHERE s.id = ?1 AND e.state = 'begun' AND e.begun_utc_ns <= ?2 AND x.attempt_id IS NULL "
        "AND x.task = ?3 AND x.knee_case = c.name AND ifnull(x.case_hash, c.hash) = c.hash "
        "AND ifnull(x.hand, ?4) = ?4 AND NOT EXISTS (SELECT 1 FROM exam_task y JOIN attempt a "
        "ON a.id = y.attempt_id WHERE a.session_id = ?1 AND a.number = ?5) "
        "ORDER BY x.exam_id, x.position LIMIT 1",
        &place, err, "iitti", session_id, row->begun_utc_ns, row->task, row->hand,
        (int64_t)row->number);
    if (result != RESULT_OK)
        return result == RESULT_MISSING ? RESULT_OK : result;
    result = store_do(store,
                      "UPDATE exam_task SET attempt_id = (SELECT id FROM attempt "
                      "WHERE session_id = ? AND number = ?) WHERE rowid = ?",
                      err, "iii", session_id, (int64_t)row->number, place);
    if (result == RESULT_OK)
        result =
            store_do(store,
                     "UPDATE exam SET state = 'done' WHERE id = "
                     "(SELECT exam_id FROM exam_task WHERE rowid = ?1) AND NOT EXISTS "
                     "(SELECT 1 FROM exam_task WHERE exam_id = exam.id AND attempt_id IS NULL)",
                     err, "i", place);
    return result;
}

static enum result find_attempt_session(struct store *store, const char *session, int64_t *out_id,
                                        bool *out_erased, struct error *err) {
    int64_t erased;
    enum result result =
        store_find(store, "SELECT id FROM session WHERE uuid = ?", out_id, err, "t", session);
    if (result == RESULT_MISSING)
        return fail(err, result, "%s: there is no session '%.40s'", store->path, session);
    if (result != RESULT_OK)
        return result;
    result = store_find(store,
                        "SELECT t.id FROM session s JOIN trainee t ON t.id = s.trainee_id "
                        "WHERE s.id = ? AND t.erased_utc_ns IS NOT NULL",
                        &erased, err, "i", *out_id);
    *out_erased = result == RESULT_OK;
    return result == RESULT_MISSING ? RESULT_OK : result;
}

static enum result put_new(struct store *store, int64_t session_id, const struct attempt_row *row,
                           bool *out_new, struct error *err) {
    int64_t id;
    enum result result =
        store_find(store, "SELECT id FROM attempt WHERE session_id = ? AND number = ?", &id, err,
                   "ii", session_id, (int64_t)row->number);
    *out_new = result == RESULT_MISSING;
    return *out_new || result == RESULT_OK ? put_attempt(store, session_id, row, err) : result;
}

enum result store_attempt_count(struct store *store, const char *session, int64_t *out_count,
                                struct error *err) {
    return store_find(store,
                      "SELECT count(*) FROM attempt a JOIN session s ON s.id = a.session_id "
                      "WHERE s.uuid = ?",
                      out_count, err, "t", session);
}

enum result store_attempt_add(struct store *store, const struct attempt_row *row, bool *out_new,
                              struct error *err) {
    int64_t session_id;
    bool erased = false;
    *out_new = false;
    enum result result = check_texts(row, err);
    if (result == RESULT_OK)
        result = check_numbers(row, err);
    if (result == RESULT_OK)
        result = check_json(store, row->figures, "object", "figures", err);
    if (result == RESULT_OK)
        result = check_json(store, row->occurrences, "array", "occurrences", err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find_attempt_session(store, row->session, &session_id, &erased, err);
    if (result == RESULT_OK && !erased)
        result = put_new(store, session_id, row, out_new, err);
    if (result == RESULT_OK && !erased && !strcmp(row->purpose, "exam"))
        result = join_exam(store, session_id, row, err);
    return store_end(store, result, err);
}

// ---- reading ------------------------------------------------------------------------------------

enum result store_attempt_list(struct store *store, const struct attempt_filter *f,
                               store_row_handler take, void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        STORE_ATTEMPTS
        "WHERE (?1 IS NULL OR s.trainee_id IN (SELECT trainee_id FROM enrolment WHERE course_id = "
        "(SELECT id FROM course WHERE name = ?1))) AND (?2 IS NULL OR a.task = ?2) AND "
        "(?3 IS NULL OR (trainee.name = ?3 AND s.id NOT IN " STORE_BLIND_SESSIONS(
            "?13") ")) AND (?4 IS NULL OR s.uuid = ?4) AND "
                   "(?5 IS NULL OR a.purpose = ?5) AND (?6 IS NULL OR a.hand = ?6) AND "
                   "(?7 = 0 OR a.begun_utc_ns >= ?7) AND (?8 = 0 OR a.begun_utc_ns < ?8) AND "
                   "(?9 = 0 OR a.number = ?9) AND (?10 IS NULL OR (a.begun_utc_ns, a.id) < "
                   "(SELECT b.begun_utc_ns, b.id FROM attempt b JOIN session t ON t.id = "
                   "b.session_id "
                   "WHERE t.uuid = ?10 AND b.number = ?11 AND (?3 IS NULL OR (t.trainee_id = "
                   "s.trainee_id "
                   "AND t.id NOT IN " STORE_BLIND_SESSIONS(
                       "?13") ")))) "
                              "AND (?14 = 0 OR " STORE_ATTEMPT_COUNTS
                              ") ORDER BY a.begun_utc_ns DESC, a.id DESC LIMIT ?12",
        &statement, err, "ttttttiiitiiti", f->course, f->task, f->trainee, f->session, f->purpose,
        f->hand, f->from_utc_ns, f->to_utc_ns, (int64_t)f->number, f->before_session,
        (int64_t)f->before_number, (int64_t)f->limit, f->rater, (int64_t)f->counted);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}
