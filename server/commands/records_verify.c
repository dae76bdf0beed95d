#include "commands/records_verify.h"

#include "records/audit_head.h"
#include "records/audit_seal.h"

#include <limits.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <string.h>

// ---- results of exams ---------------------------------------------------------------------------

struct exams {
    const char *authority;
    int checked;
    enum result result; // the first error
    struct error *err;
};

static const char *text_of_column(const struct store_cell *cells, int count, const char *column) {
    for (int i = 0; i < count; i++)
        if (!strcmp(cells[i].column, column) && cells[i].kind == STORE_TEXT)
            return cells[i].text;
    return "";
}

static bool has_hash(const char *text, const char *wanted) {
    uint8_t hash[32];
    char hex[STORE_HASH_MAX];
    if (!EVP_Digest(text, strlen(text), hash, NULL, EVP_sha256(), NULL))
        return false;
    for (int i = 0; i < 32; i++)
        snprintf(hex + 2 * i, 3, "%02x", hash[i]);
    return !strcmp(hex, wanted);
}

static void check_exam(void *user, const struct store_cell *cells, int count) {
    struct exams *exams = user;
    struct store_audit_seal seal = {.head.entry = cells[0].integer};
    char signed_by[TRACE_SIGNED_BY_MAX];
    const char *result = text_of_column(cells, count, "result");
    if (exams->result != RESULT_OK || !result[0])
        return;
    for (int i = 0; i < count; i++)
        if (!strcmp(cells[i].column, "released_utc_ns"))
            seal.utc_ns = cells[i].integer;
    snprintf(seal.head.hash, sizeof seal.head.hash, "%s",
             text_of_column(cells, count, "result_hash"));
    snprintf(seal.certificate, sizeof seal.certificate, "%s",
             text_of_column(cells, count, "certificate"));
    snprintf(seal.signature, sizeof seal.signature, "%s",
             text_of_column(cells, count, "signature"));
    if (!has_hash(result, seal.head.hash))
        exams->result = fail(exams->err, RESULT_CORRUPT, "the result of exam %lld was changed",
                             (long long)seal.head.entry);
    else
        exams->result = exam_seal_check(&seal, exams->authority, signed_by, exams->err);
    exams->checked++;
}

static enum result check_exams(struct store *store, const char *authority, json_t *said,
                               struct error *err) {
    struct exams exams = {.authority = authority, .err = err};
    enum result result = store_rows(store, LIST_EXAMS, NULL, check_exam, &exams, err);
    json_object_set_new(said, "signed_exams", json_integer(exams.checked));
    return result == RESULT_OK ? exams.result : result;
}

// ---- the audit log ------------------------------------------------------------------------------

static enum result check_signature(struct store *store, const char *keys, json_t *said,
                                   struct error *err) {
    char authority[PATH_MAX], signed_by[TRACE_SIGNED_BY_MAX];
    struct store_audit_head kept;
    struct store_audit_seal seal;
    if (snprintf(authority, sizeof authority, "%s/authority.pem", keys) >= (int)sizeof authority)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", keys);
    enum result result = audit_head_check(store, authority, &kept, err);
    if (result == RESULT_OK)
        result = store_audit_seal(store, &seal, err);
    if (result == RESULT_OK)
        result = audit_seal_check(&seal, authority, signed_by, err);
    if (result == RESULT_OK)
        result = store_audit_has(store, &seal.head, err);
    if (result != RESULT_OK)
        return result;
    json_object_set_new(said, "signed_entry", json_integer(seal.head.entry));
    json_object_set_new(said, "signed_utc_ns", json_integer(seal.utc_ns));
    json_object_set_new(said, "signed_by", json_string(signed_by));
    return check_exams(store, authority, said, err);
}

enum result records_verify(struct store *store, const char *keys, const char *entry,
                           json_t **out_said, struct error *err) {
    struct store_audit_head head, wanted;
    *out_said = json_object();
    if (entry && !audit_head_parse(entry, &wanted))
        return fail(err, RESULT_INVALID, "--entry %.100s is not NUMBER:HASH", entry);
    enum result result = store_verify_audit(store, &head, err);
    if (result == RESULT_OK && entry)
        result = store_audit_has(store, &wanted, err);
    if (result != RESULT_OK)
        return result;
    json_object_set_new(*out_said, "entries", json_integer(head.entry));
    json_object_set_new(*out_said, "hash", json_string(head.hash));
    return keys ? check_signature(store, keys, *out_said, err) : RESULT_OK;
}

void records_verify_print(json_t *said) {
    json_int_t entries = json_integer_value(json_object_get(said, "entries"));
    json_t *signed_entry = json_object_get(said, "signed_entry");
    printf("the audit log is whole: %lld entries; the last one is %lld:%s\n", (long long)entries,
           (long long)entries, json_string_value(json_object_get(said, "hash")));
    if (signed_entry)
        printf("it is signed up to entry %lld by %s\n", (long long)json_integer_value(signed_entry),
               json_string_value(json_object_get(said, "signed_by")));
    if (json_integer_value(json_object_get(said, "signed_exams")))
        printf("the results of %lld exams are signed\n",
               (long long)json_integer_value(json_object_get(said, "signed_exams")));
    if (!signed_entry)
        puts("its signature was not checked: name the server's keys with --keys DIR");
}
