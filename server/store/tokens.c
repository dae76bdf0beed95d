#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "store/database.h"
#include "store/text.h"

#include <stdio.h>
#include <string.h>

#define HOUR_NS (3600 * NS_PER_S)
#define COOKIE_NS (12 * HOUR_NS)          // after its last use
#define COOKIE_MOST_NS (7 * 24 * HOUR_NS) // however much it is used
#define BEARER_NS (365 * 24 * HOUR_NS)
#define CODE_NS (12 * HOUR_NS)
#define NOTED_NS (300 * NS_PER_S) // a use after that long is written down
#define OWN_MAX 32

static const char *const kind_names[TOKEN_COUNT] = {"cookie", "token", "code"};
static const int64_t lives_ns[TOKEN_COUNT] = {COOKIE_NS, BEARER_NS, CODE_NS};

// ---- who ----------------------------------------------------------------------------------------

static void take_text(sqlite3_stmt *statement, int column, char *out, size_t size) {
    const char *text = (const char *)sqlite3_column_text(statement, column);
    snprintf(out, size, "%s", text ? text : "");
}

// The columns of PRINCIPAL, and of store_find_token.
enum { ACCOUNT_ID, ACCOUNT, ROLE, PASSWORD, TRAINEE_ID, TOKEN_TRAINEE, TOKEN_ENTRY, TOKEN, USED };

#define PRINCIPAL                                                                                  \
    "SELECT a.id, a.name, a.role, a.password, t.id, t.name, (SELECT max(id) FROM audit)"

static void read_principal(sqlite3_stmt *statement, struct store_principal *out) {
    *out = (struct store_principal){.role = ROLE_TRAINEE};
    out->by_account = sqlite3_column_type(statement, ACCOUNT_ID) != SQLITE_NULL;
    take_text(statement, out->by_account ? ACCOUNT : TOKEN_TRAINEE, out->name, sizeof out->name);
    take_text(statement, TOKEN_TRAINEE, out->trainee, sizeof out->trainee);
    take_text(statement, PASSWORD, out->password, sizeof out->password);
    if (out->by_account)
        store_role_from_name((const char *)sqlite3_column_text(statement, ROLE), &out->role);
    long long account = sqlite3_column_int64(statement, ACCOUNT_ID);
    long long trainee = sqlite3_column_int64(statement, TRAINEE_ID);
    out->number = out->by_account ? account : trainee;
    out->entry = sqlite3_column_int64(statement, TOKEN_ENTRY);
    if (sqlite3_column_count(statement) > TOKEN)
        out->token = sqlite3_column_int64(statement, TOKEN);
    if (out->role != ROLE_TRAINEE)
        snprintf(out->actor, sizeof out->actor, "%s", out->name);
    else if (trainee)
        snprintf(out->actor, sizeof out->actor, "trainee %lld", trainee);
    else
        snprintf(out->actor, sizeof out->actor, "account %lld", account);
}

// The first row of a statement with the columns of PRINCIPAL.
static enum result find_principal(struct store *store, sqlite3_stmt *statement,
                                  struct store_principal *out, struct error *err) {
    int code = sqlite3_step(statement);
    enum result result = RESULT_OK;
    if (code == SQLITE_ROW)
        read_principal(statement, out);
    else if (code == SQLITE_DONE)
        result =
            fail(err, RESULT_MISSING, "%s: there is no such account, token or code", store->path);
    else
        result = store_failed(store, code, err);
    return result;
}

enum result store_find_account(struct store *store, const char *name, struct store_principal *out,
                               struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(store,
                                       PRINCIPAL " FROM account a LEFT JOIN trainee t ON "
                                                 "t.id = a.trainee_id WHERE a.name = ?",
                                       &statement, err, "t", name);
    if (result != RESULT_OK)
        return result;
    result = find_principal(store, statement, out, err);
    sqlite3_reset(statement);
    return result;
}

// ---- tokens -------------------------------------------------------------------------------------

// A principal may enter even if the use cannot be recorded. The end of a cookie moves, up to its
// maximum age or the end of its code.
static void note_use(struct store *store, int64_t token, int64_t now_ns) {
    struct error err;
    if (store_do(store,
                 "UPDATE token SET used_utc_ns = ?1, until_utc_ns = iif(kind = 'cookie', "
                 "min(?1 + ?2, created_utc_ns + ?3, ifnull((SELECT c.until_utc_ns FROM token c "
                 "WHERE c.kind = 'code' AND c.trainee_id = token.trainee_id), ?1 + ?2)), "
                 "until_utc_ns) WHERE id = ?4",
                 &err, "iiii", now_ns, (int64_t)COOKIE_NS, (int64_t)COOKIE_MOST_NS,
                 token) != RESULT_OK)
        log_warning("store", "the use of a token cannot be recorded: %s", err.text);
}

// A cookie has a maximum age. A cookie of a code also needs that code, which is older than it.
#define IS_VALID                                                                                   \
    "k.until_utc_ns > ?2 AND (k.kind = 'token' OR (k.kind = 'cookie' AND "                         \
    "k.created_utc_ns > ?2 - ?3 AND (k.trainee_id IS NULL OR EXISTS (SELECT 1 FROM token c "       \
    "WHERE c.trainee_id = k.trainee_id AND c.kind = 'code' AND c.until_utc_ns > ?2 AND "           \
    "c.id < k.id))))"

enum result store_find_token(struct store *store, const char *hash, struct store_principal *out,
                             struct error *err) {
    sqlite3_stmt *statement;
    int64_t now_ns = clock_utc_ns(), used_ns = 0;
    enum result result =
        store_prepare(store,
                      PRINCIPAL ", k.id, k.used_utc_ns FROM token k "
                                "LEFT JOIN account a ON a.id = k.account_id LEFT JOIN trainee t ON "
                                "t.id = coalesce(k.trainee_id, a.trainee_id) "
                                "WHERE k.hash = ?1 AND " IS_VALID,
                      &statement, err, "tii", hash, now_ns, (int64_t)COOKIE_MOST_NS);
    if (result != RESULT_OK)
        return result;
    result = find_principal(store, statement, out, err);
    if (result == RESULT_OK)
        used_ns = sqlite3_column_int64(statement, USED);
    sqlite3_reset(statement);
    if (result == RESULT_OK && now_ns - used_ns > NOTED_NS)
        note_use(store, out->token, now_ns);
    return result;
}

enum result store_find_code(struct store *store, const char *hash, struct store_principal *out,
                            struct error *err) {
    sqlite3_stmt *statement;
    enum result result = store_prepare(
        store,
        "SELECT NULL, NULL, NULL, NULL, t.id, t.name, (SELECT max(id) FROM audit), k.id "
        "FROM token k JOIN trainee t ON "
        "t.id = k.trainee_id WHERE k.hash = ? AND k.until_utc_ns > ? AND "
        "k.kind = 'code'",
        &statement, err, "ti", hash, clock_utc_ns());
    if (result != RESULT_OK)
        return result;
    result = find_principal(store, statement, out, err);
    sqlite3_reset(statement);
    return result;
}

// Deletes everything that has ended, and all but the newest `keep` of this owner.
static enum result make_room(struct store *store, enum store_token_kind kind, int64_t account,
                             int64_t trainee, int keep, int64_t now_ns, struct error *err) {
    enum result result =
        store_do(store, "DELETE FROM token WHERE until_utc_ns <= ?", err, "i", now_ns);
    if (result == RESULT_OK)
        result = store_do(store,
                          "DELETE FROM token WHERE id IN (SELECT id FROM token WHERE kind = ? AND "
                          "ifnull(account_id, 0) = ? AND ifnull(trainee_id, 0) = ? "
                          "ORDER BY id DESC LIMIT -1 OFFSET ?)",
                          err, "tiii", kind_names[kind], account, trainee, (int64_t)keep);
    return result;
}

static enum result check_room(struct store *store, int64_t account, int64_t trainee,
                              struct error *err) {
    int64_t count = 0;
    enum result result = store_find(store,
                                    "SELECT count(*) FROM token WHERE kind = 'token' AND "
                                    "ifnull(account_id, 0) = ? AND ifnull(trainee_id, 0) = ?",
                                    &count, err, "ii", account, trainee);
    if (result == RESULT_OK && count >= OWN_MAX)
        return fail(err, RESULT_LIMIT, "this account already has %d tokens; delete one of them",
                    OWN_MAX);
    return result;
}

// When one that begins now ends: a cookie of a code with the code.
static enum result find_end(struct store *store, enum store_token_kind kind, int64_t trainee,
                            int64_t now_ns, int64_t *out_until_ns, struct error *err) {
    *out_until_ns = now_ns + lives_ns[kind];
    if (kind != TOKEN_COOKIE || !trainee)
        return RESULT_OK;
    int64_t code_ns = *out_until_ns;
    enum result result = store_find(store,
                                    "SELECT until_utc_ns FROM token WHERE kind = 'code' AND "
                                    "trainee_id = ?",
                                    &code_ns, err, "i", trainee);
    if (code_ns < *out_until_ns)
        *out_until_ns = code_ns;
    return result == RESULT_MISSING ? RESULT_OK : result;
}

// account or trainee is 0. Inside a transaction.
static enum result insert_token(struct store *store, enum store_token_kind kind, const char *hash,
                                int64_t account, int64_t trainee, const char *name,
                                int64_t *out_until_ns, struct error *err) {
    int64_t now_ns = clock_utc_ns();
    int keep = kind == TOKEN_COOKIE ? OWN_MAX - 1 : kind == TOKEN_CODE ? 0 : OWN_MAX;
    enum result result = make_room(store, kind, account, trainee, keep, now_ns, err);
    if (result == RESULT_OK && kind == TOKEN_BEARER)
        result = check_room(store, account, trainee, err);
    if (result == RESULT_OK)
        result = find_end(store, kind, trainee, now_ns, out_until_ns, err);
    if (result == RESULT_OK)
        result = store_do(
            store,
            "INSERT INTO token (id, kind, hash, account_id, trainee_id, name, "
            "created_utc_ns, until_utc_ns) "
            "VALUES (" STORE_NEXT_AUTO("token") ", ?, ?, nullif(?, 0), nullif(?, 0), ?, ?, ?)",
            err, "ttiitii", kind_names[kind], hash, account, trainee, name, now_ns, *out_until_ns);
    return result;
}

static enum result find_owner(struct store *store, const struct store_principal *owner,
                              int64_t *out_account, int64_t *out_trainee, struct error *err) {
    *out_account = *out_trainee = 0;
    if (owner->by_account)
        return store_find_named(store, &account_table, owner->name, out_account, err);
    return store_find_named(store, &trainee_table, owner->name, out_trainee, err);
}

// Since the lookup, the password may have changed, or somebody may have signed the owner out.
// Inside a transaction.
static enum result check_unchanged(struct store *store, const struct store_principal *owner,
                                   struct error *err) {
    int64_t id;
    enum result result = RESULT_OK;
    if (owner->by_account)
        result =
            store_find(store,
                       "SELECT id FROM account WHERE name = ? AND password IS nullif(?, '') AND "
                       "NOT EXISTS (SELECT * FROM audit WHERE audit.id > ? AND action = 'sign out' "
                       "AND subject IN ('account ' || account.id, 'trainee ' || trainee_id))",
                       &id, err, "tti", owner->name, owner->password, owner->entry);
    if (result == RESULT_OK && owner->token)
        result = store_find(store, "SELECT id FROM token WHERE id = ? AND until_utc_ns > ?", &id,
                            err, "ii", owner->token, clock_utc_ns());
    if (result == RESULT_MISSING)
        fail(err, result, "%s: %s was signed out, or has another password now", store->path,
             owner->name);
    return result;
}

enum result store_add_token(struct store *store, enum store_token_kind kind, const char *hash,
                            const struct store_principal *owner, const char *name, int64_t *out_id,
                            int64_t *out_until_utc_ns, struct error *err) {
    int64_t account, trainee;
    CHECK(kind == TOKEN_COOKIE || kind == TOKEN_BEARER);
    enum result result = name ? text_check(name, "token's name", STORE_NAME_MAX, err) : RESULT_OK;
    if (result == RESULT_OK)
        result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = check_unchanged(store, owner, err);
    if (result == RESULT_OK)
        result = find_owner(store, owner, &account, &trainee, err);
    if (result == RESULT_OK)
        result = insert_token(store, kind, hash, account, trainee, name, out_until_utc_ns, err);
    *out_id = sqlite3_last_insert_rowid(store->db);
    if (result == RESULT_OK)
        result = store_audit(store, kind == TOKEN_COOKIE ? "sign in" : "add",
                             kind == TOKEN_COOKIE ? "cookie" : "token", *out_id, err);
    return store_end(store, result, err);
}

enum result store_add_code(struct store *store, const char *trainee, const char *hash,
                           int64_t *out_until_utc_ns, struct error *err) {
    int64_t id;
    enum result result = store_begin_named(store, &present_trainee_table, trainee, &id, err);
    if (result != RESULT_OK)
        return result;
    // Cookies of the previous code:
    result =
        store_do(store, "DELETE FROM token WHERE trainee_id = ? AND kind = 'cookie'", err, "i", id);
    if (result == RESULT_OK)
        result = insert_token(store, TOKEN_CODE, hash, 0, id, NULL, out_until_utc_ns, err);
    if (result == RESULT_OK)
        result = store_audit(store, "code", "trainee", id, err);
    return store_end(store, result, err);
}

enum result store_remove_token(struct store *store, const struct store_principal *owner, int64_t id,
                               struct error *err) {
    int64_t account, trainee, found;
    enum result result = store_begin(store, err);
    if (result != RESULT_OK)
        return result;
    result = find_owner(store, owner, &account, &trainee, err);
    if (result == RESULT_OK)
        result = store_find(store,
                            "SELECT id FROM token WHERE id = ? AND ifnull(account_id, 0) = ? AND "
                            "ifnull(trainee_id, 0) = ? AND kind <> 'code'",
                            &found, err, "iii", id, account, trainee);
    if (result == RESULT_MISSING)
        fail(err, result, "%s has no token with number %lld", owner->name, (long long)id);
    if (result == RESULT_OK)
        result = store_do(store, "DELETE FROM token WHERE id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_audit(store, "end", "token", id, err);
    return store_end(store, result, err);
}

// ---- signing out --------------------------------------------------------------------------------

enum result store_sign_out_account(struct store *store, const char *name, struct error *err) {
    int64_t id;
    enum result result = store_begin_named(store, &account_table, name, &id, err);
    if (result != RESULT_OK)
        return result;
    result = store_do(store, "DELETE FROM token WHERE account_id = ?", err, "i", id);
    if (result == RESULT_OK)
        result = store_audit(store, "sign out", "account", id, err);
    return store_end(store, result, err);
}

// Begins a transaction, and deletes the cookies of the trainee's code.
static enum result begin_sign_out(struct store *store, const char *trainee, int64_t *out_id,
                                  struct error *err) {
    enum result result = store_begin_named(store, &trainee_table, trainee, out_id, err);
    if (result != RESULT_OK)
        return result;
    result = store_do(store, "DELETE FROM token WHERE trainee_id = ? AND kind <> 'code'", err, "i",
                      *out_id);
    return result == RESULT_OK ? result : store_end(store, result, err);
}

enum result store_sign_out(struct store *store, const struct store_principal *whose,
                           struct error *err) {
    int64_t id;
    if (whose->by_account)
        return store_sign_out_account(store, whose->name, err);
    enum result result = begin_sign_out(store, whose->trainee, &id, err);
    if (result != RESULT_OK)
        return result;
    return store_end(store, store_audit(store, "sign out", "trainee", id, err), err);
}

enum result store_sign_out_trainee(struct store *store, const char *trainee, struct error *err) {
    int64_t id;
    enum result result = begin_sign_out(store, trainee, &id, err);
    if (result != RESULT_OK)
        return result;
    result = store_do(store,
                      "DELETE FROM token WHERE trainee_id = ?1 OR account_id IN "
                      "(SELECT id FROM account WHERE trainee_id = ?1)",
                      err, "i", id);
    if (result == RESULT_OK)
        result = store_audit(store, "sign out", "trainee", id, err);
    return store_end(store, result, err);
}
