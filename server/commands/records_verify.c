#include "commands/records_verify.h"

#include "base/number.h"
#include "records/audit_seal.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

static enum result read_entry(const char *text, struct store_audit_head *out, struct error *err) {
    char number[24] = "";
    const char *colon = strchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    if (length > 0 && length < sizeof number)
        memcpy(number, text, length);
    *out = (struct store_audit_head){0};
    if (!number_int(number, 1, INT64_MAX, &out->entry) || strlen(colon + 1) >= sizeof out->hash)
        return fail(err, RESULT_INVALID, "--entry %.100s is not NUMBER:HASH", text);
    snprintf(out->hash, sizeof out->hash, "%s", colon + 1);
    return RESULT_OK;
}

static enum result check_signature(struct store *store, const char *keys, json_t *said,
                                   struct error *err) {
    char authority[PATH_MAX], signed_by[TRACE_SIGNED_BY_MAX];
    struct store_audit_seal seal;
    if (snprintf(authority, sizeof authority, "%s/authority.pem", keys) >= (int)sizeof authority)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", keys);
    enum result result = store_audit_seal(store, &seal, err);
    if (result == RESULT_OK)
        result = audit_seal_check(&seal, authority, signed_by, err);
    if (result == RESULT_OK)
        result = store_audit_has(store, &seal.head, err);
    if (result != RESULT_OK)
        return result;
    json_object_set_new(said, "signed_entry", json_integer(seal.head.entry));
    json_object_set_new(said, "signed_utc_ns", json_integer(seal.utc_ns));
    json_object_set_new(said, "signed_by", json_string(signed_by));
    return RESULT_OK;
}

enum result records_verify(struct store *store, const char *keys, const char *entry,
                           json_t **out_said, struct error *err) {
    struct store_audit_head head, wanted;
    *out_said = json_object();
    enum result result = entry ? read_entry(entry, &wanted, err) : RESULT_OK;
    if (result == RESULT_OK)
        result = store_verify_audit(store, &head, err);
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
    else
        puts("its signature was not checked: name the server's keys with --keys DIR");
}
