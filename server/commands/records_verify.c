#include "commands/records_verify.h"

#include "records/audit_head.h"
#include "records/audit_seal.h"

#include <limits.h>
#include <stdio.h>

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
    return RESULT_OK;
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
    else
        puts("its signature was not checked: name the server's keys with --keys DIR");
}
