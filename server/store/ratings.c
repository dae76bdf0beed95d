#include "base/clock.h"
#include "store/database.h"
#include "store/exams.h"
#include "store/text.h"

#define SUM                                                                                        \
    "r.safety + r.field_of_view + r.camera_dexterity + r.instrument_dexterity + "                  \
    "r.bimanual_dexterity + r.flow + r.quality + r.autonomy"
#define LEAST                                                                                      \
    "min(r.safety, r.field_of_view, r.camera_dexterity, r.instrument_dexterity, "                  \
    "r.bimanual_dexterity, r.flow, r.quality, r.autonomy)"

const char *const rating_domain_names[RATING_DOMAINS] = {
    "safety", "field_of_view", "camera_dexterity", "instrument_dexterity", "bimanual_dexterity",
    "flow",   "quality",       "autonomy"};

int rating_domain_most(enum rating_domain domain) {
    return domain == RATING_AUTONOMY ? 3 : 5;
}

static enum result check_rating(const int levels[RATING_DOMAINS], const char *remark,
                                struct error *err) {
    for (int i = 0; i < RATING_DOMAINS; i++)
        if (levels[i] < 1 || levels[i] > rating_domain_most((enum rating_domain)i))
            return fail(err, RESULT_INVALID, "the level of %s is not from 1 to %d",
                        rating_domain_names[i], rating_domain_most((enum rating_domain)i));
    return remark ? text_check(remark, "remark", STORE_TEXT_MAX, err) : RESULT_OK;
}

// What was released does not change any more, and what is an exam's is rated by its raters.
static enum result find_open(struct store *store, const char *session, int number, int64_t account,
                             int64_t *out_id, struct error *err) {
    int64_t released, other;
    enum result result = store_find(store,
                                    "SELECT a.id FROM attempt a JOIN session s ON "
                                    "s.id = a.session_id WHERE s.uuid = ? AND a.number = ?",
                                    out_id, err, "ti", session, (int64_t)number);
    if (result == RESULT_MISSING)
        return fail(err, result, "%s: session %.40s has no attempt %d", store->path, session,
                    number);
    if (result == RESULT_OK)
        result = store_find(store,
                            "SELECT count(*) FROM exam_task x JOIN exam e ON e.id = x.exam_id "
                            "WHERE x.attempt_id = ? AND e.state = 'released'",
                            &released, err, "i", *out_id);
    if (result == RESULT_OK && released)
        result =
            fail(err, RESULT_REFUSED, "%s: the exam of this attempt was released", store->path);
    if (result == RESULT_OK)
        result = store_find(store,
                            "SELECT EXISTS (SELECT 1 FROM exam_task x WHERE x.attempt_id = ?1) AND "
                            "NOT EXISTS (SELECT 1 FROM exam_task x JOIN exam_rater r ON "
                            "r.exam_id = x.exam_id WHERE x.attempt_id = ?1 AND r.account_id = ?2)",
                            &other, err, "ii", *out_id, account);
    if (result == RESULT_OK && other)
        result = fail(err, RESULT_REFUSED, "%s: only its raters rate the attempt of an exam",
                      store->path);
    return result;
}

enum result store_put_rating(struct store *store, const char *session, int number, int64_t account,
                             const int levels[RATING_DOMAINS], const char *remark,
                             struct error *err) {
    int64_t id;
    const int *l = levels;
    enum result result = check_rating(levels, remark, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find_open(store, session, number, account, &id, err);
    if (result == RESULT_OK)
        result = store_do(
            store,
            "INSERT INTO rating (id, attempt_id, account_id, utc_ns, safety, field_of_view, "
            "camera_dexterity, instrument_dexterity, bimanual_dexterity, flow, quality, autonomy, "
            "remark) VALUES (" STORE_NEXT(
                "rating") ", ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
                          "ON CONFLICT (attempt_id, account_id) DO UPDATE SET utc_ns = "
                          "excluded.utc_ns, "
                          "safety = excluded.safety, field_of_view = excluded.field_of_view, "
                          "camera_dexterity = excluded.camera_dexterity, "
                          "instrument_dexterity = excluded.instrument_dexterity, "
                          "bimanual_dexterity = excluded.bimanual_dexterity, flow = excluded.flow, "
                          "quality = excluded.quality, autonomy = excluded.autonomy, remark = "
                          "excluded.remark",
            err, "iiiiiiiiiiit", id, account, clock_utc_ns(), (int64_t)l[0], (int64_t)l[1],
            (int64_t)l[2], (int64_t)l[3], (int64_t)l[4], (int64_t)l[5], (int64_t)l[6],
            (int64_t)l[7], remark);
    if (result == RESULT_OK)
        result = store_audit(store, "rate", "attempt", id, err);
    return store_end(store, result, err);
}

enum result store_ratings_of(struct store *store, const char *session, int number,
                             store_row_handler take, void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result =
        store_prepare(store, STORE_RATINGS "WHERE s.uuid = ? AND a.number = ? ORDER BY r.id",
                      &statement, err, "ti", session, (int64_t)number);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_to_rate(struct store *store, int64_t account, store_row_handler take, void *user,
                          struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT s.uuid AS session, a.number, e.id AS exam, a.task, a.title, x.knee_case AS "
        "\"case\", a.time_s FROM exam_rater q JOIN exam e ON e.id = q.exam_id "
        "JOIN exam_task x ON x.exam_id = e.id JOIN attempt a ON a.id = x.attempt_id "
        "JOIN session s ON s.id = a.session_id WHERE q.account_id = ?1 AND e.state <> 'released' "
        "AND NOT EXISTS (SELECT 1 FROM rating r WHERE r.attempt_id = a.id AND "
        "r.account_id = ?1) ORDER BY e.id, x.position",
        &statement, err, "i", account);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_rated_twice(struct store *store, const char *course, store_row_handler take,
                              void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT r.attempt_id AS attempt, " SUM " AS sum, " LEAST " >= ?2 AS competent "
        "FROM rating r JOIN attempt a ON a.id = r.attempt_id "
        "JOIN session s ON s.id = a.session_id JOIN enrolment e ON e.trainee_id = s.trainee_id "
        "JOIN course c ON c.id = e.course_id WHERE c.name = ?1 AND (SELECT count(*) FROM rating q "
        "WHERE q.attempt_id = a.id) > 1 AND EXISTS (SELECT 1 FROM exam_task x JOIN exam_rater w "
        "ON w.exam_id = x.exam_id WHERE x.attempt_id = a.id AND w.account_id = r.account_id) "
        "ORDER BY r.attempt_id, r.id",
        &statement, err, "ti", course, (int64_t)RATING_COMPETENT);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}
