// The audit log: each entry has a hash over itself and the hash of the entry before it. Servers
// that share the records each have a chain of their own.
#include "base/check.h"
#include "base/clock.h"
#include "store/database.h"
#include "store/text.h"

#include <openssl/evp.h>
#include <stdio.h>
#include <string.h>

#define FIRST "0000000000000000000000000000000000000000000000000000000000000000" // before entry 1

// ---- hashes -------------------------------------------------------------------------------------

// With its length before it, so that no two lists of fields have the same bytes.
static void add_field(EVP_MD_CTX *context, const char *text) {
    char length[24];
    snprintf(length, sizeof length, "%zu:", strlen(text));
    int done = EVP_DigestUpdate(context, length, strlen(length)) &&
               EVP_DigestUpdate(context, text, strlen(text));
    CHECK(done);
}

// fields: the hash before, then the number, the time, the actor, the action and the subject.
static void hash_entry(const char *const fields[6], char out_hash[STORE_HASH_MAX]) {
    uint8_t hash[32];
    EVP_MD_CTX *context = EVP_MD_CTX_new();
    int done = context && EVP_DigestInit_ex(context, EVP_sha256(), NULL);
    CHECK(done);
    for (int i = 0; i < 6; i++)
        add_field(context, fields[i]);
    done = EVP_DigestFinal_ex(context, hash, NULL);
    CHECK(done);
    EVP_MD_CTX_free(context);
    for (int i = 0; i < 32; i++)
        snprintf(out_hash + 2 * i, 3, "%02x", hash[i]);
}

// The SQL function audit_hash(before, id, utc_ns, actor, action, subject).
static void sql_audit_hash(sqlite3_context *context, int count, sqlite3_value **values) {
    const char *fields[6];
    char hash[STORE_HASH_MAX];
    CHECK(count == 6);
    for (int i = 0; i < 6; i++) {
        fields[i] = (const char *)sqlite3_value_text(values[i]);
        if (!fields[i]) {
            sqlite3_result_null(context);
            return;
        }
    }
    hash_entry(fields, hash);
    sqlite3_result_text(context, hash, -1, SQLITE_TRANSIENT);
}

// The SQL function number_of(text): 48 bits.
static void sql_number_of(sqlite3_context *context, int count, sqlite3_value **values) {
    const char *text = (const char *)sqlite3_value_text(values[0]);
    uint8_t hash[32];
    int64_t number = 0;
    CHECK(count == 1);
    int done =
        EVP_Digest(text ? text : "", text ? strlen(text) : 0, hash, NULL, EVP_sha256(), NULL);
    CHECK(done);
    for (int i = 0; i < 6; i++)
        number = number << 8 | hash[i];
    sqlite3_result_int64(context, number);
}

enum result store_add_functions(struct store *store, struct error *err) {
    const int flags = SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_DIRECTONLY;
    int code = sqlite3_create_function(store->db, "audit_hash", 6, flags, NULL, sql_audit_hash,
                                       NULL, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_create_function(store->db, "number_of", 1, flags, NULL, sql_number_of, NULL,
                                       NULL);
    return code == SQLITE_OK ? RESULT_OK : store_failed(store, code, err);
}

// ---- adding -------------------------------------------------------------------------------------

// One statement, so that no entry of another program comes between.
static const char add_to_audit[] =
    "INSERT INTO audit (id, utc_ns, actor, action, subject, hash, chain) "
    "SELECT n, ?1, ?2, ?3, ?4, audit_hash(before, n, ?1, ?2, ?3, ?4), chain FROM "
    "(SELECT " STORE_NEXT_AUTO("audit") " AS n, share.slot AS chain, "
                                        "ifnull((SELECT hash FROM audit WHERE audit.chain = "
                                        "share.slot ORDER BY id DESC LIMIT 1), "
                                        "'" FIRST "') AS before FROM share)";

enum result store_put_audit(struct store *store, const struct store_audit_entry *entry,
                            struct error *err) {
    enum result result = text_check(entry->actor, "actor", sizeof entry->actor, err);
    if (result == RESULT_OK)
        result = text_check(entry->action, "action", sizeof entry->action, err);
    if (result == RESULT_OK)
        result = text_check(entry->subject, "action's subject", sizeof entry->subject, err);
    if (result == RESULT_OK)
        result = store_do(store, add_to_audit, err, "ittt", entry->utc_ns, entry->actor,
                          entry->action, entry->subject);
    return result;
}

enum result store_audit(struct store *store, const char *action, const char *kind, int64_t id,
                        struct error *err) {
    char subject[STORE_NAME_MAX];
    snprintf(subject, sizeof subject, id ? "%s %lld" : "%s", kind, (long long)id);
    return store_note(store, action, subject, err);
}

enum result store_note(struct store *store, const char *action, const char *subject,
                       struct error *err) {
    return store_do(store, add_to_audit, err, "ittt", clock_utc_ns(), store->actor, action,
                    subject);
}

// ---- checking -----------------------------------------------------------------------------------

static void copy_text(sqlite3_stmt *statement, int column, char *out, size_t size) {
    const char *text = (const char *)sqlite3_column_text(statement, column);
    snprintf(out, size, "%s", text ? text : "");
}

enum { AUDIT_ENTRY, ENTRY_HASH = 5, CHAIN, IS_ALONE, IS_OWN };

// The entry in the statement's row follows `head`, which becomes it. The numbers of one chain among
// several have gaps.
static enum result check_entry(struct store *store, sqlite3_stmt *statement,
                               struct store_audit_head *head, struct error *err) {
    const char *fields[6] = {head->hash};
    char hash[STORE_HASH_MAX], stored[STORE_HASH_MAX];
    int64_t entry = sqlite3_column_int64(statement, AUDIT_ENTRY);
    if (entry != head->entry + 1 && sqlite3_column_int(statement, IS_ALONE))
        return fail(err, RESULT_CORRUPT, "%s: entry %lld of the audit log is missing", store->path,
                    (long long)head->entry + 1);
    for (int i = 0; i < 5; i++) {
        const char *text = (const char *)sqlite3_column_text(statement, i);
        fields[i + 1] = text ? text : "";
    }
    hash_entry(fields, hash);
    copy_text(statement, ENTRY_HASH, stored, sizeof stored);
    if (strcmp(hash, stored) != 0)
        return fail(err, RESULT_CORRUPT,
                    "%s: entry %lld of the audit log, or one before it, was changed", store->path,
                    (long long)entry);
    *head = (struct store_audit_head){.entry = entry};
    memcpy(head->hash, hash, sizeof hash);
    return RESULT_OK;
}

static enum result check_end(struct store *store, int64_t newest, struct error *err) {
    int64_t last = 0;
    enum result result =
        store_find(store, "SELECT seq FROM sqlite_sequence WHERE name = 'audit'", &last, err, "");
    if (result == RESULT_OK && last != newest)
        return fail(err, RESULT_CORRUPT, "%s: entry %lld of the audit log is missing", store->path,
                    (long long)newest + 1);
    return result == RESULT_MISSING ? RESULT_OK : result;
}

struct audit_check {
    int chain;
    struct store_audit_head head;
    int64_t newest; // of all chains
};

static enum result check_row(struct store *store, sqlite3_stmt *statement, struct audit_check *c,
                             struct store_audit_head *out_own, struct error *err) {
    int chain = sqlite3_column_int(statement, CHAIN);
    if (chain != c->chain)
        c->head = (struct store_audit_head){.hash = FIRST};
    c->chain = chain;
    enum result result = check_entry(store, statement, &c->head, err);
    if (c->head.entry > c->newest)
        c->newest = c->head.entry;
    if (sqlite3_column_int(statement, IS_OWN))
        *out_own = c->head;
    return result;
}

enum result store_verify_audit(struct store *store, struct store_audit_head *out_head,
                               struct error *err) {
    sqlite3_stmt *statement;
    struct audit_check check = {.head.hash = FIRST};
    int code = SQLITE_DONE;
    *out_head = check.head;
    enum result result = store_run(store, "BEGIN", err); // others go on writing
    if (result != RESULT_OK)
        return result;
    result =
        store_prepare(store,
                      "SELECT audit.id, utc_ns, actor, action, subject, hash, chain, step = 1, "
                      "chain = slot FROM audit, share ORDER BY chain, audit.id",
                      &statement, err, "");
    while (result == RESULT_OK && (code = sqlite3_step(statement)) == SQLITE_ROW)
        result = check_row(store, statement, &check, out_head, err);
    if (result == RESULT_OK && code != SQLITE_DONE)
        result = store_failed(store, code, err);
    sqlite3_reset(statement);
    if (result == RESULT_OK)
        result = check_end(store, check.newest, err);
    return store_end(store, result, err);
}

// ---- the end of the chain, and its signature ----------------------------------------------------

static enum result read_audit_head(struct store *store, sqlite3_stmt *statement,
                                   struct store_audit_head *out, struct error *err) {
    int code = sqlite3_step(statement);
    enum result result = RESULT_OK;
    if (code == SQLITE_ROW) {
        out->entry = sqlite3_column_int64(statement, 0);
        copy_text(statement, 1, out->hash, sizeof out->hash);
    } else if (code == SQLITE_DONE) {
        result = RESULT_MISSING;
    } else {
        result = store_failed(store, code, err);
    }
    sqlite3_reset(statement);
    return result;
}

enum result store_audit_head(struct store *store, struct store_audit_head *out_head,
                             struct error *err) {
    sqlite3_stmt *statement;
    *out_head = (struct store_audit_head){.hash = FIRST};
    enum result result =
        store_prepare(store,
                      "SELECT id, hash FROM audit WHERE chain = (SELECT slot FROM share) "
                      "ORDER BY id DESC LIMIT 1",
                      &statement, err, "");
    if (result == RESULT_OK)
        result = read_audit_head(store, statement, out_head, err);
    return result == RESULT_MISSING ? RESULT_OK : result;
}

enum result store_audit_has(struct store *store, const struct store_audit_head *head,
                            struct error *err) {
    int64_t id;
    enum result result = store_find(store, "SELECT id FROM audit WHERE id = ? AND hash = ?", &id,
                                    err, "it", head->entry, head->hash);
    if (result == RESULT_MISSING)
        fail(err, result, "%s: entry %lld of the audit log is missing, or was changed", store->path,
             (long long)head->entry);
    return result;
}

enum result store_put_audit_seal(struct store *store, const struct store_audit_seal *seal,
                                 struct error *err) {
    return store_do(store,
                    "INSERT OR REPLACE INTO audit_seal (chain, entry, hash, utc_ns, certificate, "
                    "signature) VALUES ((SELECT slot FROM share), ?, ?, ?, ?, ?)",
                    err, "ititt", seal->head.entry, seal->head.hash, seal->utc_ns,
                    seal->certificate, seal->signature);
}

enum result store_audit_seal(struct store *store, struct store_audit_seal *out_seal,
                             struct error *err) {
    sqlite3_stmt *statement;
    *out_seal = (struct store_audit_seal){0};
    enum result result =
        store_prepare(store,
                      "SELECT entry, hash, utc_ns, certificate, signature FROM audit_seal "
                      "WHERE chain = (SELECT slot FROM share)",
                      &statement, err, "");
    if (result != RESULT_OK)
        return result;
    int code = sqlite3_step(statement);
    if (code == SQLITE_ROW) {
        out_seal->head.entry = sqlite3_column_int64(statement, 0);
        copy_text(statement, 1, out_seal->head.hash, sizeof out_seal->head.hash);
        out_seal->utc_ns = sqlite3_column_int64(statement, 2);
        copy_text(statement, 3, out_seal->certificate, sizeof out_seal->certificate);
        copy_text(statement, 4, out_seal->signature, sizeof out_seal->signature);
    } else if (code == SQLITE_DONE) {
        result = fail(err, RESULT_MISSING, "%s: no server has signed the audit log", store->path);
    } else {
        result = store_failed(store, code, err);
    }
    sqlite3_reset(statement);
    return result;
}
