#include "base/check.h"
#include "store/database.h"

#include <string.h>

#define COLUMNS_MAX 32

#define SESSIONS                                                                                   \
    "SELECT s.uuid AS id, station.name AS station, trainee.name AS trainee, "                      \
    "knee_case.name AS \"case\", knee_case.hash AS case_hash, s.start_utc_ns, s.end_utc_ns, "      \
    "s.state, s.steps, s.missing, s.trace, s.trace_xxh3, s.trace_hash, s.part, s.server FROM "     \
    "session s "                                                                                   \
    "JOIN station ON station.id = s.station_id JOIN knee_case ON knee_case.id = s.case_id "        \
    "LEFT JOIN trainee ON trainee.id = s.trainee_id "

// ?1: the key, or NULL for all.
static const struct {
    const char *name, *sql;
} lists[LIST_COUNT] = {
    [LIST_TRAINEES] = {"trainees",
                       "SELECT t.name, t.full_name, t.created_utc_ns, t.erased_utc_ns, "
                       "(SELECT count(*) FROM session WHERE trainee_id = t.id) AS sessions "
                       "FROM trainee t WHERE ?1 IS NULL OR t.name = ?1 ORDER BY t.id"},
    [LIST_COURSES] = {"courses",
                      "SELECT c.name, c.created_utc_ns, "
                      "(SELECT count(*) FROM enrolment WHERE course_id = c.id) AS trainees "
                      "FROM course c WHERE ?1 IS NULL OR c.name = ?1 ORDER BY c.id"},
    [LIST_ENROLMENTS] = {"enrolments",
                         "SELECT course.name AS course, trainee.name AS trainee FROM enrolment "
                         "JOIN course ON course.id = course_id "
                         "JOIN trainee ON trainee.id = trainee_id "
                         "WHERE ?1 IS NULL OR course.name = ?1 ORDER BY course.id, trainee.id"},
    [LIST_STATIONS] = {"stations",
                       "SELECT st.name, count(s.id) AS sessions, max(s.start_utc_ns) AS "
                       "last_start_utc_ns FROM station st LEFT JOIN session s ON "
                       "s.station_id = st.id WHERE ?1 IS NULL OR st.name = ?1 "
                       "GROUP BY st.id ORDER BY st.name"},
    [LIST_CASES] = {"cases", "SELECT c.name, c.hash, "
                             "(SELECT count(*) FROM session WHERE case_id = c.id) AS sessions "
                             "FROM knee_case c WHERE ?1 IS NULL OR c.name = ?1 "
                             "ORDER BY c.name, c.rowid"},
    [LIST_SESSIONS] = {"sessions", SESSIONS "WHERE ?1 IS NULL OR s.uuid = ?1 ORDER BY s.id"},
    [LIST_PARTS] = {"parts",
                    "SELECT s.uuid AS session, p.number, p.server, p.end_utc_ns, p.state, p.steps, "
                    "p.missing, p.trace, p.trace_xxh3, p.trace_hash FROM part p "
                    "JOIN session s ON s.id = p.session_id "
                    "WHERE (?1 IS NULL OR s.uuid = ?1) AND p.number < s.part "
                    "ORDER BY s.id, p.number"},
    [LIST_RESULTS] = {"results",
                      "SELECT s.uuid AS session, r.metric, r.subject, r.version, r.unit, r.value, "
                      "r.details FROM result r JOIN session s ON s.id = r.session_id "
                      "WHERE ?1 IS NULL OR s.uuid = ?1 "
                      "ORDER BY s.id, r.metric, r.subject, r.version"},
    [LIST_ACCOUNTS] = {"accounts",
                       "SELECT a.name, a.role, trainee.name AS trainee, "
                       "a.password IS NOT NULL AS can_log_in, a.created_utc_ns FROM account a "
                       "LEFT JOIN trainee ON trainee.id = a.trainee_id "
                       "WHERE ?1 IS NULL OR a.name = ?1 ORDER BY a.id"},
    [LIST_TOKENS] = {"tokens", "SELECT k.id, k.kind, a.name AS account, t.name AS trainee, k.name, "
                               "k.created_utc_ns, k.until_utc_ns, k.used_utc_ns FROM token k "
                               "LEFT JOIN account a ON a.id = k.account_id "
                               "LEFT JOIN trainee t ON t.id = k.trainee_id "
                               "WHERE ?1 IS NULL OR ?1 IN (a.name, t.name) ORDER BY k.id"},
    [LIST_AUDIT] = {"audit", "SELECT utc_ns, actor, action, subject FROM audit "
                             "WHERE ?1 IS NULL OR subject = ?1 ORDER BY id"},
    [LIST_ATTEMPTS] = {"attempts", STORE_ATTEMPTS "WHERE ?1 IS NULL OR s.uuid = ?1 ORDER BY a.id"},
    [LIST_CURRICULA] = {"curricula",
                        "SELECT course.name AS course, c.version, c.state, c.changed_utc_ns, "
                        "t.position, t.task, t.week, t.passes, t.hands, t.due_utc_ns, t.cases, "
                        "t.after FROM curriculum c JOIN course ON course.id = c.course_id "
                        "JOIN curriculum_task t ON t.curriculum_id = c.id "
                        "WHERE ?1 IS NULL OR course.name = ?1 "
                        "ORDER BY course.id, c.version, t.position"},
    [LIST_MARKS] = {"marks", "SELECT task, version, task_version, kind, source, time_s, errors, "
                             "created_utc_ns FROM pass_mark WHERE ?1 IS NULL OR task = ?1 "
                             "ORDER BY task, version"},
    [LIST_EXAMS] = {"exams", STORE_EXAMS "WHERE ?1 IS NULL OR e.id = ?1 ORDER BY e.id"},
    [LIST_EXAM_TASKS] = {"exam_tasks",
                         "SELECT x.exam_id AS exam, x.position, x.task, x.knee_case AS \"case\", "
                         "x.case_hash, x.hand, s.uuid AS session, a.number, a.verdict "
                         "FROM exam_task x LEFT JOIN attempt a ON a.id = x.attempt_id "
                         "LEFT JOIN session s ON s.id = a.session_id "
                         "WHERE ?1 IS NULL OR x.exam_id = ?1 ORDER BY x.exam_id, x.position"},
    [LIST_INTERVENTIONS] = {"interventions",
                            "SELECT exam_id AS exam, utc_ns, reason FROM intervention "
                            "WHERE ?1 IS NULL OR exam_id = ?1 ORDER BY id"},
    [LIST_RATINGS] = {"ratings", STORE_RATINGS "WHERE ?1 IS NULL OR s.uuid = ?1 ORDER BY r.id"},
    [LIST_EXAM_RATERS] = {"exam_raters",
                          "SELECT r.exam_id AS exam, account.name AS rater FROM exam_rater r "
                          "JOIN account ON account.id = r.account_id "
                          "WHERE ?1 IS NULL OR r.exam_id = ?1 ORDER BY 1, account.id"},
};

const char *store_list_name(enum store_list list) {
    return lists[list].name;
}

bool store_list_from_name(const char *name, enum store_list *out_list) {
    for (int i = 0; i < LIST_COUNT; i++)
        if (!strcmp(name, lists[i].name)) {
            *out_list = (enum store_list)i;
            return true;
        }
    return false;
}

static struct store_cell read_cell(sqlite3_stmt *statement, int column) {
    struct store_cell cell = {.column = sqlite3_column_name(statement, column)};
    switch (sqlite3_column_type(statement, column)) {
    case SQLITE_INTEGER:
        cell.kind = STORE_INTEGER;
        cell.integer = sqlite3_column_int64(statement, column);
        break;
    case SQLITE_FLOAT:
        cell.kind = STORE_REAL;
        cell.real = sqlite3_column_double(statement, column);
        break;
    case SQLITE_TEXT:
        cell.kind = STORE_TEXT;
        cell.text = (const char *)sqlite3_column_text(statement, column);
        break;
    default: // also a blob, which no table of ours has
        cell.kind = STORE_NULL;
    }
    return cell;
}

static int read_row(sqlite3_stmt *statement, struct store_cell cells[COLUMNS_MAX]) {
    int count = sqlite3_column_count(statement);
    CHECK(count <= COLUMNS_MAX);
    for (int i = 0; i < count; i++)
        cells[i] = read_cell(statement, i);
    return count;
}

enum result store_each_row(struct store *store, sqlite3_stmt *statement, store_row_handler take,
                           void *user, struct error *err) {
    struct store_cell cells[COLUMNS_MAX];
    enum result result = RESULT_OK;
    int code;
    while ((code = sqlite3_step(statement)) == SQLITE_ROW) {
        int count = read_row(statement, cells);
        take(user, cells, count);
    }
    if (code != SQLITE_DONE)
        result = store_failed(store, code, err);
    sqlite3_reset(statement);
    return result;
}

static enum result read_all(struct store *store, const char *sql, const char *key,
                            store_row_handler take, void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(store, sql, &statement, err, "t", key);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_rows(struct store *store, enum store_list list, const char *key,
                       store_row_handler take, void *user, struct error *err) {
    return read_all(store, lists[list].sql, key, take, user, err);
}

enum result store_columns(struct store *store, enum store_list list, store_row_handler take,
                          void *user, struct error *err) {
    struct store_cell cells[COLUMNS_MAX] = {0};
    sqlite3_stmt *statement;
    enum result result = store_prepare(store, lists[list].sql, &statement, err, "t", NULL);
    if (result != RESULT_OK)
        return result;
    int count = sqlite3_column_count(statement);
    CHECK(count <= COLUMNS_MAX);
    for (int i = 0; i < count; i++)
        cells[i].column = sqlite3_column_name(statement, i);
    take(user, cells, count);
    return RESULT_OK;
}

enum result store_sessions_of(struct store *store, const char *trainee, store_row_handler take,
                              void *user, struct error *err) {
    return read_all(store, SESSIONS "WHERE trainee.name = ?1 ORDER BY s.id", trainee, take, user,
                    err);
}

enum result store_find_sessions(struct store *store, const struct store_filter *filter,
                                store_row_handler take, void *user, struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        SESSIONS "WHERE (?1 IS NULL OR (trainee.name = ?1 AND s.id NOT IN " STORE_BLIND_SESSIONS(
            "?6") ")) AND (?2 IS NULL OR s.trainee_id IN "
                  "(SELECT trainee_id FROM enrolment WHERE course_id = "
                  "(SELECT id FROM course WHERE name = ?2))) AND (?3 IS NULL OR knee_case.name = "
                  "?3) AND "
                  "(?4 IS NULL OR (s.start_utc_ns, s.id) < "
                  "(SELECT b.start_utc_ns, b.id FROM session b LEFT JOIN trainee w ON w.id = "
                  "b.trainee_id "
                  "WHERE b.uuid = ?4 AND (?1 IS NULL OR (w.name = ?1 AND b.id NOT "
                  "IN " STORE_BLIND_SESSIONS(
                      "?6") ")))) "
                            "ORDER BY s.start_utc_ns DESC, s.id DESC LIMIT ?5",
        &statement, err, "ttttit", filter->trainee, filter->course, filter->case_name,
        filter->before, (int64_t)filter->limit, filter->rater);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_last_audit(struct store *store, int limit, store_row_handler take, void *user,
                             struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store, "SELECT utc_ns, actor, action, subject FROM audit ORDER BY id DESC LIMIT ?",
        &statement, err, "i", (int64_t)limit);
    return result == RESULT_OK ? store_each_row(store, statement, take, user, err) : result;
}

enum result store_trainees_in(struct store *store, const char *course, store_row_handler take,
                              void *user, struct error *err) {
    return read_all(store,
                    "SELECT t.name, t.full_name FROM trainee t JOIN enrolment e ON "
                    "e.trainee_id = t.id JOIN course c ON c.id = e.course_id WHERE c.name = ?1 "
                    "ORDER BY t.name",
                    course, take, user, err);
}

enum result store_courses_of(struct store *store, const char *trainee, store_row_handler take,
                             void *user, struct error *err) {
    return read_all(store,
                    "SELECT c.name FROM course c JOIN enrolment e ON e.course_id = c.id "
                    "JOIN trainee t ON t.id = e.trainee_id WHERE t.name = ?1 ORDER BY c.name",
                    trainee, take, user, err);
}
