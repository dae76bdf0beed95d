#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "store/database.h"
#include "store/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

// ---- adding -------------------------------------------------------------------------------------

enum result store_add_trainee(struct store *store, const char *name, const char *full_name,
                              struct error *err) {
    enum result result = text_check(name, "trainee's name", STORE_NAME_MAX, err);
    if (result == RESULT_OK && full_name)
        result = text_check(full_name, "trainee's full name", STORE_TEXT_MAX, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = store_must_be_new(store, &trainee_table, name, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT INTO trainee (id, name, full_name, created_utc_ns) "
                          "VALUES (" STORE_NEXT("trainee") ", ?, ?, ?)",
                          err, "tti", name, full_name, clock_utc_ns());
    return store_end_added(store, result, "trainee", err);
}

enum result store_add_course(struct store *store, const char *name, struct error *err) {
    enum result result = text_check(name, "course's name", STORE_NAME_MAX, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = store_must_be_new(store, &course_table, name, err);
    if (result == RESULT_OK)
        result = store_do(
            store,
            "INSERT INTO course (id, name, created_utc_ns) VALUES (" STORE_NEXT("course") ", ?, ?)",
            err, "ti", name, clock_utc_ns());
    return store_end_added(store, result, "course", err);
}

// Inside a transaction in which the trainee was found.
static enum result change_enrolment(struct store *store, const char *sql, int64_t trainee_id,
                                    const char *course, struct error *err) {
    int64_t course_id;
    enum result result = store_find_named(store, &course_table, course, &course_id, err);
    return result == RESULT_OK ? store_do(store, sql, err, "ii", trainee_id, course_id) : result;
}

enum result store_enrol(struct store *store, const char *trainee, const char *course,
                        struct error *err) {
    int64_t id;
    enum result result = store_begin_named(store, &trainee_table, trainee, &id, err);
    if (result != RESULT_OK)
        return result;
    result = change_enrolment(
        store, "INSERT OR IGNORE INTO enrolment (trainee_id, course_id) VALUES (?, ?)", id, course,
        err);
    if (result == RESULT_OK)
        result = store_audit(store, "enrol", "trainee", id, err);
    return store_end(store, result, err);
}

enum result store_unenrol(struct store *store, const char *trainee, const char *course,
                          struct error *err) {
    int64_t id;
    enum result result = store_begin_named(store, &trainee_table, trainee, &id, err);
    if (result != RESULT_OK)
        return result;
    result = change_enrolment(store, "DELETE FROM enrolment WHERE trainee_id = ? AND course_id = ?",
                              id, course, err);
    if (result == RESULT_OK && !sqlite3_changes(store->db))
        result = fail(err, RESULT_MISSING, "%s: trainee '%s' is not in course '%s'", store->path,
                      trainee, course);
    if (result == RESULT_OK)
        result = store_audit(store, "unenrol", "trainee", id, err);
    return store_end(store, result, err);
}

// ---- changing -----------------------------------------------------------------------------------

// Inside a transaction.
static enum result set_full_name(struct store *store, int64_t id, const char *full_name,
                                 struct error *err) {
    enum result result =
        store_do(store, "UPDATE trainee SET full_name = nullif(?, '') WHERE id = ?", err, "ti",
                 full_name, id);
    return result == RESULT_OK ? store_audit(store, "full name", "trainee", id, err) : result;
}

enum result store_change_trainee(struct store *store, const char *name, const char *new_name,
                                 const char *full_name, struct error *err) {
    int64_t id;
    enum result result =
        new_name ? text_check(new_name, "trainee's name", STORE_NAME_MAX, err) : RESULT_OK;
    if (result == RESULT_OK && full_name && full_name[0])
        result = text_check(full_name, "trainee's full name", STORE_TEXT_MAX, err);
    if (result == RESULT_OK)
        result = store_begin_named(store, &present_trainee_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    if (new_name)
        result = store_rename_row(store, &trainee_table, id, new_name, err);
    if (result == RESULT_OK && full_name)
        result = set_full_name(store, id, full_name, err);
    return store_end(store, result, err);
}

enum result store_rename_course(struct store *store, const char *name, const char *new_name,
                                struct error *err) {
    int64_t id;
    enum result result = text_check(new_name, "course's name", STORE_NAME_MAX, err);
    if (result == RESULT_OK)
        result = store_begin_named(store, &course_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    return store_end(store, store_rename_row(store, &course_table, id, new_name, err), err);
}

enum result store_remove_course(struct store *store, const char *name, struct error *err) {
    int64_t id;
    enum result result = store_begin_named(store, &course_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    result = store_do(store, "DELETE FROM enrolment WHERE course_id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_do(store, "DELETE FROM course WHERE id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_audit(store, "remove", "course", id, err);
    return store_end(store, result, err);
}

// ---- erasing, removing --------------------------------------------------------------------------

// Random, so that it reveals nothing about the person.
static void make_pseudonym(char out[STORE_NAME_MAX]) {
    uint64_t chance;
    chance_fill(&chance, sizeof chance);
    snprintf(out, STORE_NAME_MAX, "erased-%016" PRIx64, chance);
}

// Removes everything of a trainee except the sessions and what belongs to them.
static enum result remove_belongings(struct store *store, int64_t id, struct error *err) {
    enum result result =
        store_do(store, "DELETE FROM enrolment WHERE trainee_id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_do(store,
                          "DELETE FROM token WHERE trainee_id = ?1 OR account_id IN "
                          "(SELECT id FROM account WHERE trainee_id = ?1)",
                          err, "i", id);
    if (result == RESULT_OK)
        result = store_do(store, "DELETE FROM account WHERE trainee_id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_do(store, "DELETE FROM exam WHERE trainee_id = ?", err, "i", id);
    return result;
}

static enum result erase_rows(struct store *store, int64_t id, const char *pseudonym,
                              struct error *err) {
    enum result result = remove_belongings(store, id, err);
    if (result == RESULT_OK) // and the ratings of them
        result = store_do(store,
                          "DELETE FROM attempt WHERE session_id IN "
                          "(SELECT id FROM session WHERE trainee_id = ?)",
                          err, "i", id);
    if (result == RESULT_OK)
        result = store_do(store,
                          "UPDATE trainee SET name = ?, full_name = NULL, erased_utc_ns = ? "
                          "WHERE id = ?",
                          err, "tii", pseudonym, clock_utc_ns(), id);
    if (result == RESULT_OK)
        result = store_audit(store, "erase", "trainee", id, err);
    store->erases = true;
    return result;
}

// SQLite's log beside the file still contains the overwritten data.
static void cut_log(struct store *store) {
    int code = sqlite3_wal_checkpoint_v2(store->db, NULL, SQLITE_CHECKPOINT_TRUNCATE, NULL, NULL);
    if (code != SQLITE_OK)
        log_warning("store",
                    "%s: what was erased stays in %s-wal until no other program has the records "
                    "open",
                    store->path, store->path);
}

enum result store_erase_trainee(struct store *store, const char *name,
                                char out_pseudonym[STORE_NAME_MAX], struct error *err) {
    int64_t id;
    make_pseudonym(out_pseudonym);
    enum result result = store_begin_named(store, &trainee_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    result = store_end(store, erase_rows(store, id, out_pseudonym, err), err);
    if (result == RESULT_OK)
        cut_log(store);
    return result;
}

enum result store_remove_trainee(struct store *store, const char *name, struct error *err) {
    int64_t id, sessions;
    enum result result = store_begin_named(store, &trainee_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT count(*) FROM session WHERE trainee_id = ?", &sessions, err,
                        "i", id);
    if (result == RESULT_OK && sessions)
        result = fail(err, RESULT_REFUSED,
                      "%s: trainee '%s' has %lld sessions; erase the trainee instead", store->path,
                      name, (long long)sessions);
    if (result == RESULT_OK)
        result = remove_belongings(store, id, err);
    if (result == RESULT_OK)
        result = store_do(store, "DELETE FROM trainee WHERE id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_audit(store, "remove", "trainee", id, err);
    store->erases = true;
    result = store_end(store, result, err);
    if (result == RESULT_OK)
        cut_log(store);
    return result;
}
