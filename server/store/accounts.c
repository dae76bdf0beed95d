// Accounts: roles, passwords and names.
#include "base/check.h"
#include "base/clock.h"
#include "store/database.h"
#include "store/text.h"

#include <string.h>

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

// ---- adding -------------------------------------------------------------------------------------

enum result store_check_password(const char *password, struct error *err) {
    enum result result = text_check(password, "account's password", STORE_TEXT_MAX, err);
    if (result == RESULT_OK && strncmp(password, "$argon2", 7) != 0)
        result = fail(err, RESULT_INVALID,
                      "argon2 has not encoded the account's password ($argon2id$v=19$...)");
    return result;
}

// In the audit log these words mean the server itself, and people without an account of their own.
static bool is_reserved(const char *name) {
    static const char *const words[] = {"trainee ", "account "};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        size_t length = strlen(words[i]);
        if (!strncmp(name, words[i], length) && strspn(name + length, "0123456789"))
            return true;
    }
    return !strcmp(name, "server");
}

static enum result check_name(const char *name, struct error *err) {
    enum result result = text_check(name, "account's name", STORE_NAME_MAX, err);
    return result == RESULT_OK && is_reserved(name)
               ? fail(err, RESULT_INVALID,
                      "an account cannot be called '%s': the audit log calls others so", name)
               : result;
}

static enum result check_account(const char *name, const char *password, struct error *err) {
    enum result result = check_name(name, err);
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
    result = store_must_be_new(store, &account_table, name, err);
    if (result == RESULT_OK && trainee)
        result = store_find_named(store, &trainee_table, trainee, &trainee_id, err);
    if (result == RESULT_OK)
        result = store_do(store,
                          "INSERT INTO account (id, name, role, password, trainee_id, "
                          "created_utc_ns) VALUES (" STORE_NEXT(
                              "account") ", ?, ?, ?, (SELECT id FROM trainee WHERE name = ?), ?)",
                          err, "tttti", name, role_names[role], password, trainee, clock_utc_ns());
    return store_end_added(store, result, "account", err);
}

// ---- changing -----------------------------------------------------------------------------------

static const char instructors[] = "SELECT count(*) FROM account WHERE role = 'instructor' AND "
                                  "password IS NOT NULL";

enum result store_has_instructor(struct store *store, bool *out_has, struct error *err) {
    int64_t count = 0;
    enum result result = store_find(store, instructors, &count, err, "");
    *out_has = count > 0;
    return result;
}

static enum result end_tokens(struct store *store, int64_t account, struct error *err) {
    return store_do(store, "DELETE FROM token WHERE account_id = ?", err, "i", account);
}

// Inside a transaction, after a change. had: there was an instructor before it.
static enum result keep_an_instructor(struct store *store, bool had, struct error *err) {
    bool has;
    enum result result = store_has_instructor(store, &has, err);
    if (result == RESULT_OK && had && !has)
        return fail(err, RESULT_REFUSED, "this is the last instructor who can sign in");
    return result;
}

// Begins a transaction in which the account is found, with nobody signed in to it any more.
static enum result begin_account_change(struct store *store, const char *name, int64_t *out_id,
                                        bool *out_had, struct error *err) {
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = store_has_instructor(store, out_had, err);
    if (result == RESULT_OK)
        result = store_find_named(store, &account_table, name, out_id, err);
    if (result == RESULT_OK)
        result = end_tokens(store, *out_id, err);
    return result == RESULT_OK ? result : store_end(store, result, err);
}

static enum result end_account_change(struct store *store, enum result result, const char *action,
                                      int64_t id, bool had, struct error *err) {
    if (result == RESULT_OK)
        result = keep_an_instructor(store, had, err);
    if (result == RESULT_OK)
        result = store_audit(store, action, "account", id, err);
    return store_end(store, result, err);
}

enum result store_remove_account(struct store *store, const char *name, struct error *err) {
    int64_t id;
    bool had;
    enum result result = begin_account_change(store, name, &id, &had, err);
    if (result != RESULT_OK)
        return result;
    result = store_do(store, "DELETE FROM account WHERE id = ?", err, "i", id);
    return end_account_change(store, result, "remove", id, had, err);
}

enum result store_set_role(struct store *store, const char *name, enum store_role role,
                           struct error *err) {
    int64_t id;
    bool had;
    CHECK((unsigned)role < ROLE_COUNT);
    enum result result = begin_account_change(store, name, &id, &had, err);
    if (result != RESULT_OK)
        return result;
    result = store_do(store, "UPDATE account SET role = ? WHERE id = ?", err, "ti",
                      store_role_name(role), id);
    return end_account_change(store, result, store_role_name(role), id, had, err);
}

enum result store_set_password(struct store *store, const char *name, const char *password,
                               struct error *err) {
    int64_t id;
    bool had;
    enum result result = store_check_password(password, err);
    if (result == RESULT_OK)
        result = begin_account_change(store, name, &id, &had, err);
    if (result != RESULT_OK)
        return result;
    result =
        store_do(store, "UPDATE account SET password = ? WHERE id = ?", err, "ti", password, id);
    return end_account_change(store, result, "password", id, had, err);
}

enum result store_change_password(struct store *store, const struct store_principal *whose,
                                  const char *password, struct error *err) {
    int64_t id;
    bool had;
    enum result result = store_check_password(password, err);
    if (result == RESULT_OK)
        result = begin_account_change(store, whose->name, &id, &had, err);
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT id FROM account WHERE id = ? AND password = ?", &id, err,
                        "it", id, whose->password);
    if (result == RESULT_MISSING)
        fail(err, result, "%s: %s has another password now", store->path, whose->name);
    if (result == RESULT_OK)
        result = store_do(store, "UPDATE account SET password = ? WHERE id = ?", err, "ti",
                          password, id);
    return end_account_change(store, result, "password", id, had, err);
}

enum result store_rename_account(struct store *store, const char *name, const char *new_name,
                                 struct error *err) {
    int64_t id;
    enum result result = check_name(new_name, err);
    if (result == RESULT_OK)
        result = store_begin_named(store, &account_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    return store_end(store, store_rename_row(store, &account_table, id, new_name, err), err);
}
