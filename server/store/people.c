#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "store/connection.h"
#include "store/text.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

static const char *const role_names[ROLE_COUNT] = {"technician", "instructor", "trainee"};

const char *store_role_name(enum store_role role) {
    return role_names[role];
}

bool store_role_from_name(const char *name, enum store_role *out_role) {
    for (int i = 0; i < ROLE_COUNT; i++)
        if (!strcmp(name, role_names[i])) {
            *out_role = (enum store_role)i;
            return true;
        }
    return false;
}

static enum result find_trainee(struct store *store, const char *name, int64_t *out_id,
                                struct error *err) {
    return store_find_named(store, "SELECT id FROM trainee WHERE name = ?", "trainee", name, out_id,
                            err);
}

// RESULT_OK where nothing has that name.
static enum result must_be_new(struct store *store, const char *sql, const char *what,
                               const char *name, struct error *err) {
    int64_t id;
    enum result result = store_find(store, sql, &id, err, "t", name);
    if (result == RESULT_OK)
        return fail(err, RESULT_REFUSED, "%s: there is a %s '%s' already", store->path, what, name);
    return result == RESULT_MISSING ? RESULT_OK : result;
}

static enum result added(struct store *store, enum result result, const char *kind,
                         struct error *err) {
    if (result == RESULT_OK)
        result = store_audit(store, "add", kind, sqlite3_last_insert_rowid(store->db), err);
    return store_end(store, result, err);
}

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
    result = must_be_new(store, "SELECT id FROM trainee WHERE name = ?", "trainee", name, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT INTO trainee (name, full_name, created_utc_ns) VALUES (?, ?, ?)",
                          err, "tti", name, full_name, clock_utc_ns());
    return added(store, result, "trainee", err);
}

enum result store_add_course(struct store *store, const char *name, struct error *err) {
    enum result result = text_check(name, "course's name", STORE_NAME_MAX, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = must_be_new(store, "SELECT id FROM course WHERE name = ?", "course", name, err);
    if (result == RESULT_OK)
        result = store_do(store, "INSERT INTO course (name, created_utc_ns) VALUES (?, ?)", err,
                          "ti", name, clock_utc_ns());
    return added(store, result, "course", err);
}

enum result store_enrol(struct store *store, const char *trainee, const char *course,
                        struct error *err) {
    int64_t trainee_id = 0, course_id;
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find_trainee(store, trainee, &trainee_id, err);
    if (result == RESULT_OK)
        result = store_find_named(store, "SELECT id FROM course WHERE name = ?", "course", course,
                                  &course_id, err);
    if (result == RESULT_OK)
        result =
            store_do(store, "INSERT OR IGNORE INTO enrolment (trainee_id, course_id) VALUES (?, ?)",
                     err, "ii", trainee_id, course_id);
    if (result == RESULT_OK)
        result = store_audit(store, "enrol", "trainee", trainee_id, err);
    return store_end(store, result, err);
}

enum result store_check_password(const char *password, struct error *err) {
    enum result result = text_check(password, "account's password", STORE_TEXT_MAX, err);
    if (result == RESULT_OK && strncmp(password, "$argon2", 7) != 0)
        result = fail(err, RESULT_INVALID,
                      "the account's password is not encoded by argon2 ($argon2id$v=19$...)");
    return result;
}

static enum result check_account(const char *name, const char *password, struct error *err) {
    enum result result = text_check(name, "account's name", STORE_NAME_MAX, err);
    return result == RESULT_OK && password ? store_check_password(password, err) : result;
}

enum result store_add_account(struct store *store, const char *name, enum store_role role,
                              const char *password, const char *trainee, struct error *err) {
    CHECK((unsigned)role < ROLE_COUNT);
    enum result result = check_account(name, password, err);
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    int64_t trainee_id;
    result = must_be_new(store, "SELECT id FROM account WHERE name = ?", "account", name, err);
    if (result == RESULT_OK && trainee)
        result = find_trainee(store, trainee, &trainee_id, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT INTO account (name, role, password, trainee_id, created_utc_ns) "
                          "VALUES (?, ?, ?, (SELECT id FROM trainee WHERE name = ?), ?)",
                          err, "tttti", name, role_names[role], password, trainee, clock_utc_ns());
    return added(store, result, "account", err);
}

// ---- erasing ------------------------------------------------------------------------------------

// Made by chance, so that it tells nothing of whom it stands for.
static void make_pseudonym(char out[STORE_NAME_MAX]) {
    uint64_t chance;
    ssize_t got = getrandom(&chance, sizeof chance, 0);
    CHECK(got == sizeof chance);
    snprintf(out, STORE_NAME_MAX, "erased-%016" PRIx64, chance);
}

static enum result erase_rows(struct store *store, int64_t id, const char *pseudonym,
                              struct error *err) {
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
        result = store_do(store,
                          "UPDATE trainee SET name = ?, full_name = NULL, erased_utc_ns = ? "
                          "WHERE id = ?",
                          err, "tii", pseudonym, clock_utc_ns(), id);
    if (result == RESULT_OK)
        result = store_audit(store, "erase", "trainee", id, err);
    return result;
}

// What was overwritten is still in the log that SQLite writes beside the file.
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
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find_trainee(store, name, &id, err);
    if (result == RESULT_OK)
        result = erase_rows(store, id, out_pseudonym, err);
    result = store_end(store, result, err);
    if (result == RESULT_OK)
        cut_log(store);
    return result;
}
