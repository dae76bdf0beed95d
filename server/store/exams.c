#include "store/exams.h"

#include "base/check.h"
#include "base/clock.h"
#include "store/database.h"
#include "store/text.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- planning -----------------------------------------------------------------------------------

static enum result check_plan(const struct exam_plan *plan, struct error *err) {
    enum result result = text_check(plan->title, "exam's title", sizeof plan->title, err);
    if (result == RESULT_OK && (plan->count < 1 || plan->count > EXAM_TASKS_MAX))
        result = fail(err, RESULT_INVALID, "an exam has 1 to %d tasks", EXAM_TASKS_MAX);
    for (int i = 0; i < plan->count && result == RESULT_OK; i++) {
        const struct exam_task *t = &plan->tasks[i];
        result = text_check(t->task, "task's name", sizeof t->task, err);
        if (result == RESULT_OK)
            result = text_check(t->knee_case, "case's name", sizeof t->knee_case, err);
    }
    return result;
}

static enum result put_exam_task(struct store *store, int64_t id, int at,
                                 const struct exam_task *task, struct error *err) {
    return store_do(store,
                    "INSERT INTO exam_task (exam_id, position, task, knee_case, hand) "
                    "VALUES (?, ?, ?, ?, nullif(?, ''))",
                    err, "iittt", id, (int64_t)at, task->task, task->knee_case, task->hand);
}

static enum result put_rater(struct store *store, int64_t id, const char *name, struct error *err) {
    int64_t account;
    enum result result =
        store_find(store, "SELECT id FROM account WHERE name = ? AND role = 'instructor'", &account,
                   err, "t", name);
    if (result == RESULT_MISSING)
        return fail(err, RESULT_INVALID, "rater '%s' is no account of an instructor", name);
    if (result == RESULT_OK)
        result =
            store_do(store, "INSERT OR IGNORE INTO exam_rater (exam_id, account_id) VALUES (?, ?)",
                     err, "ii", id, account);
    return result;
}

static enum result put_exam(struct store *store, int64_t trainee_id, const struct exam_plan *plan,
                            int64_t *out_id, struct error *err) {
    int64_t course_id;
    enum result result = store_find_named(store, &course_table, plan->course, &course_id, err);
    if (result == RESULT_OK)
        result = store_find(store, "SELECT 1 FROM enrolment WHERE trainee_id = ? AND course_id = ?",
                            out_id, err, "ii", trainee_id, course_id);
    if (result == RESULT_MISSING)
        return fail(err, RESULT_MISSING, "%s: trainee '%s' is not in a course '%s'", store->path,
                    plan->trainee, plan->course);
    if (result == RESULT_OK)
        result = store_do(
            store,
            "INSERT INTO exam (id, course_id, trainee_id, title, state, seed, "
            "created_utc_ns) VALUES (" STORE_NEXT_AUTO("exam") ", ?, ?, ?, 'planned', ?, ?)",
            err, "iitii", course_id, trainee_id, plan->title, plan->seed, clock_utc_ns());
    *out_id = sqlite3_last_insert_rowid(store->db);
    for (int i = 0; i < plan->count && result == RESULT_OK; i++)
        result = put_exam_task(store, *out_id, i, &plan->tasks[i], err);
    for (int i = 0; i < plan->rater_count && result == RESULT_OK; i++)
        result = put_rater(store, *out_id, plan->raters[i], err);
    return result;
}

enum result store_add_exam(struct store *store, const struct exam_plan *plan, int64_t *out_id,
                           struct error *err) {
    int64_t trainee_id;
    enum result result = check_plan(plan, err);
    if (result == RESULT_OK)
        result = store_begin_named(store, &present_trainee_table, plan->trainee, &trainee_id, err);
    if (result != RESULT_OK)
        return result;
    result = put_exam(store, trainee_id, plan, out_id, err);
    if (result == RESULT_OK)
        result = store_audit(store, "add", "exam", *out_id, err);
    return store_end(store, result, err);
}

// ---- from state to state ------------------------------------------------------------------------

// Begins a transaction in which the exam has the state, or the other one.
static enum result begin_in(struct store *store, int64_t id, const char *state, const char *other,
                            struct error *err) {
    int64_t good;
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT state IN (?, ?) FROM exam WHERE id = ?", &good, err, "tti",
                        state, other, id);
    if (result == RESULT_MISSING)
        fail(err, result, "%s: there is no exam %lld", store->path, (long long)id);
    else if (result == RESULT_OK && !good)
        result =
            fail(err, RESULT_REFUSED, "%s: exam %lld is not %s", store->path, (long long)id, state);
    return result == RESULT_OK ? result : store_end(store, result, err);
}

static enum result end_with(struct store *store, enum result result, const char *action, int64_t id,
                            struct error *err) {
    if (result == RESULT_OK)
        result = store_audit(store, action, "exam", id, err);
    return store_end(store, result, err);
}

enum result store_remove_exam(struct store *store, int64_t id, struct error *err) {
    enum result result = begin_in(store, id, "planned", "planned", err);
    if (result != RESULT_OK)
        return result;
    return end_with(store, store_do(store, "DELETE FROM exam WHERE id = ?", err, "i", id), "remove",
                    id, err);
}

static enum result put_case_hashes(struct store *store, int64_t id,
                                   const struct exam_checklist *checked, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < EXAM_TASKS_MAX && result == RESULT_OK; i++)
        result = store_do(store,
                          "UPDATE exam_task SET case_hash = nullif(?, '') WHERE exam_id = ? AND "
                          "position = ?",
                          err, "tii", checked->case_hashes[i], id, (int64_t)i);
    return result;
}

enum result store_begin_exam(struct store *store, int64_t id, const struct exam_checklist *checked,
                             struct error *err) {
    if (!checked->who || !checked->station_check || !(checked->drift_mm >= 0) ||
        checked->drift_mm > EXAM_DRIFT_MAX_MM)
        return fail(err, RESULT_INVALID,
                    "the checklist is not done: it needs the person, the station's check, and a "
                    "drift of at most %g mm",
                    EXAM_DRIFT_MAX_MM);
    enum result result = begin_in(store, id, "planned", "planned", err);
    if (result != RESULT_OK)
        return result;
    result = put_case_hashes(store, id, checked, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "UPDATE exam SET state = 'begun', begun_utc_ns = ?, who = 1, "
                          "station_check = 1, case_hash = 1, drift_mm = ? WHERE id = ?",
                          err, "iri", clock_utc_ns(), checked->drift_mm, id);
    return end_with(store, result, "begin", id, err);
}

enum result store_add_intervention(struct store *store, int64_t id, const char *reason,
                                   struct error *err) {
    int64_t count;
    enum result result = text_check(reason, "reason of the intervention", STORE_TEXT_MAX, err);
    if (result == RESULT_OK)
        result = begin_in(store, id, "begun", "begun", err);
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT count(*) FROM intervention WHERE exam_id = ?", &count, err,
                        "i", id);
    if (result == RESULT_OK && count >= EXAM_INTERVENTIONS_MAX)
        result =
            fail(err, RESULT_LIMIT, "an exam has at most %d interventions", EXAM_INTERVENTIONS_MAX);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT INTO intervention (id, exam_id, utc_ns, reason) "
                          "VALUES (" STORE_NEXT("intervention") ", ?, ?, ?)",
                          err, "iit", id, clock_utc_ns(), reason);
    return end_with(store, result, "intervene", id, err);
}

static enum result keep_result(struct store *store, int64_t id, const struct exam_result *r,
                               struct error *err) {
    return store_do(store,
                    "UPDATE exam SET state = 'released', released_utc_ns = ?, verdict = ?, "
                    "result = ?, result_hash = ?, certificate = ?, signature = ? WHERE id = ?",
                    err, "ittttti", r->released_utc_ns, r->passed ? "passed" : "not yet", r->text,
                    r->hash, r->certificate, r->signature, id);
}

enum result store_release_exam(struct store *store, int64_t id, bool incomplete,
                               exam_result_maker make, void *user, struct error *err) {
    enum result result = begin_in(store, id, "done", incomplete ? "begun" : "done", err);
    if (result != RESULT_OK)
        return result;
    struct exam_result *r = alloc(1, sizeof *r);
    result = make(user, r, err);
    if (result == RESULT_OK)
        result = keep_result(store, id, r, err);
    free(r);
    return end_with(store, result, "release", id, err);
}

// ---- reading ------------------------------------------------------------------------------------

enum result store_find_exams(struct store *store, const char *course, const char *trainee,
                             const char *rater, store_row_handler take, void *user,
                             struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        STORE_EXAMS
        "WHERE (?1 IS NULL OR course.name = ?1) AND (?2 IS NULL OR "
        "(trainee.name = ?2 AND e.id NOT IN " STORE_BLIND_EXAMS("?4") ")) "
                                                                      "ORDER BY e.id DESC LIMIT ?3",
        &statement, err, "ttit", course, trainee, (int64_t)EXAMS_MAX, rater);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_exam_raters(struct store *store, int64_t id, store_row_handler take, void *user,
                              struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT account.name AS account, NOT EXISTS (SELECT 1 FROM exam_task x WHERE "
        "x.exam_id = r.exam_id AND NOT EXISTS (SELECT 1 FROM rating WHERE "
        "rating.attempt_id = x.attempt_id AND rating.account_id = r.account_id)) AS rated "
        "FROM exam_rater r JOIN account ON account.id = r.account_id WHERE r.exam_id = ? "
        "ORDER BY account.id",
        &statement, err, "i", id);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_exams_in(struct store *store, const char *course, const char *rater,
                           store_row_handler take, void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT t.name AS trainee, x.task, e.state FROM exam_task x "
        "JOIN exam e ON e.id = x.exam_id JOIN trainee t ON t.id = e.trainee_id "
        "JOIN course c ON c.id = e.course_id WHERE c.name = ?1 "
        "AND e.id NOT IN " STORE_BLIND_EXAMS("?2") " "
                                                   "ORDER BY t.name, e.id, x.position",
        &statement, err, "tt", course, rater);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

static enum result answer_if(enum result result, bool *out_is) {
    *out_is = result == RESULT_OK;
    return result == RESULT_MISSING ? RESULT_OK : result;
}

enum result store_is_blind(struct store *store, const char *account, const char *session,
                           bool *out_is, struct error *err) {
    int64_t found;
    return answer_if(store_find(store,
                                "SELECT 1 FROM session s WHERE s.uuid = ?1 AND "
                                "s.id IN " STORE_BLIND_SESSIONS("?2"),
                                &found, err, "tt", session, account),
                     out_is);
}

enum result store_is_blind_to_exam(struct store *store, const char *account, int64_t exam,
                                   bool *out_is, struct error *err) {
    int64_t found;
    return answer_if(store_find(store,
                                "SELECT 1 FROM exam e WHERE e.id = ?1 AND "
                                "e.id IN " STORE_BLIND_EXAMS("?2"),
                                &found, err, "it", exam, account),
                     out_is);
}

enum result store_is_blind_to(struct store *store, const char *account, const char *trainee,
                              bool *out_is, struct error *err) {
    int64_t found;
    return answer_if(store_find(store,
                                "SELECT 1 FROM exam e JOIN trainee t ON t.id = e.trainee_id "
                                "WHERE t.name = ?1 AND e.state IN ('begun', 'done') AND "
                                "e.id IN " STORE_BLIND_EXAMS("?2"),
                                &found, err, "tt", trainee, account),
                     out_is);
}

enum result store_blind_pairs(struct store *store, store_row_handler take, void *user,
                              struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT account.name AS account, trainee.name AS trainee FROM exam_rater r "
        "JOIN exam e ON e.id = r.exam_id JOIN account ON account.id = r.account_id "
        "JOIN trainee ON trainee.id = e.trainee_id WHERE e.state IN ('begun', 'done')",
        &statement, err, "");
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_find_exam_place(struct store *store, const struct exam_place *place,
                                  int64_t *out_exam, struct error *err) {
    char hash[17];
    snprintf(hash, sizeof hash, "%016" PRIx64, place->case_hash);
    enum result result = store_find(
        store,
        "SELECT e.id FROM exam_task x JOIN exam e ON e.id = x.exam_id "
        "JOIN trainee t ON t.id = e.trainee_id WHERE t.name = ? AND e.state = 'begun' AND "
        "x.attempt_id IS NULL AND x.task = ? AND x.knee_case = ? AND "
        "ifnull(x.case_hash, ?4) = ?4 AND ifnull(x.hand, ?5) = ?5 "
        "ORDER BY x.exam_id, x.position LIMIT 1",
        out_exam, err, "ttttt", place->trainee, place->task, place->knee_case, hash, place->hand);
    return result == RESULT_MISSING
               ? fail(err, result,
                      "no exam that '%.40s' has begun asks for task '%.31s' on case '%.40s' with "
                      "the "
                      "%s hand now",
                      place->trainee, place->task, place->knee_case, place->hand)
               : result;
}

enum result store_is_withheld(struct store *store, const char *session, bool *out_is,
                              struct error *err) {
    int64_t found;
    return answer_if(store_find(store,
                                "SELECT 1 FROM session s JOIN attempt a ON a.session_id = s.id "
                                "LEFT JOIN exam_task x ON x.attempt_id = a.id "
                                "LEFT JOIN exam e ON e.id = x.exam_id WHERE s.uuid = ? AND "
                                "a.purpose = 'exam' AND e.state IS NOT 'released'",
                                &found, err, "t", session),
                     out_is);
}
