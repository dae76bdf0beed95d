#include "records/audit_seal.h"

#include "base/bytes.h"
#include "base/check.h"
#include "base/clock.h"
#include "records/audit_head.h"

#include <stdio.h>
#include <string.h>

#define CERTIFICATE_MAX ((STORE_CERTIFICATE_MAX - 1) / 2)
#define SIGNATURE_MAX ((STORE_SIGNATURE_MAX - 1) / 2)

#define TEXT_SIZE 18
static const char audit[] = "arthron audit, end"; // a trace's message begins with another text
static const char exam[] = "arthron exams, end";

_Static_assert(sizeof audit == TEXT_SIZE + 1 && sizeof exam == TEXT_SIZE + 1, "equally long");

static void write_hex(const uint8_t *bytes, size_t size, char *out) {
    for (size_t i = 0; i < size; i++)
        snprintf(out + 2 * i, 3, "%02x", bytes[i]);
}

static int digit_of(char c) {
    static const char digits[] = "0123456789abcdef";
    const char *at = c ? strchr(digits, c) : NULL;
    return at ? (int)(at - digits) : -1;
}

// False unless they are pairs of digits, and fit.
static bool read_hex(const char *hex, uint8_t *out, size_t room, size_t *out_size) {
    size_t count = strlen(hex);
    if (count % 2 || count / 2 > room)
        return false;
    for (size_t i = 0; i < count; i += 2) {
        int high = digit_of(hex[i]), low = digit_of(hex[i + 1]);
        if (high < 0 || low < 0)
            return false;
        out[i / 2] = (uint8_t)(high << 4 | low);
    }
    *out_size = count / 2;
    return true;
}

static bool write_message(const char *text, const struct store_audit_head *head,
                          uint8_t out[TRACE_SEAL_SIZE]) {
    struct writer w = {out, TRACE_SEAL_SIZE, 0, false};
    uint8_t hash[TRACE_HASH_SIZE];
    size_t size;
    if (!read_hex(head->hash, hash, sizeof hash, &size) || size != sizeof hash)
        return false;
    write_bytes(&w, text, TEXT_SIZE);
    write_bytes(&w, hash, sizeof hash);
    write_u64(&w, (uint64_t)head->entry);
    write_u64(&w, 0);
    CHECK(!w.overflow && w.used == TRACE_SEAL_SIZE);
    return true;
}

static enum result make(const struct trace_signer *signer, const char *text,
                        const struct store_audit_head *head, struct store_audit_seal *out,
                        struct error *err) {
    uint8_t message[TRACE_SEAL_SIZE], certificate[CERTIFICATE_MAX], signature[SIGNATURE_MAX];
    size_t certificate_size = sizeof certificate, signature_size = sizeof signature;
    *out = (struct store_audit_seal){.head = *head, .utc_ns = clock_utc_ns()};
    if (!write_message(text, head, message) ||
        !signer->sign(signer->context, message, sizeof message, certificate, &certificate_size,
                      signature, &signature_size))
        return fail(err, RESULT_REFUSED, "the server has no key to sign with");
    write_hex(certificate, certificate_size, out->certificate);
    write_hex(signature, signature_size, out->signature);
    return RESULT_OK;
}

static enum result check(const char *text, const struct store_audit_seal *seal,
                         const char *authority, char out_signed_by[TRACE_SIGNED_BY_MAX],
                         struct error *err) {
    uint8_t certificate[CERTIFICATE_MAX], signature[SIGNATURE_MAX];
    struct trace_seal whole = {.certificate = certificate, .signature = signature};
    struct error why;
    out_signed_by[0] = '\0';
    if (!write_message(text, &seal->head, whole.message) ||
        !read_hex(seal->certificate, certificate, sizeof certificate, &whole.certificate_size) ||
        !read_hex(seal->signature, signature, sizeof signature, &whole.signature_size))
        return fail(err, RESULT_FORMAT, "the signature is malformed");
    enum result result = trace_seal_check(&whole, authority, seal->utc_ns, out_signed_by, &why);
    if (result == RESULT_IO)
        return fail(err, result, "%s", why.text);
    return result == RESULT_OK ? result
                               : fail(err, result, "there is no valid signature of this authority");
}

enum result audit_seal_make(const struct trace_signer *signer, const struct store_audit_head *head,
                            struct store_audit_seal *out, struct error *err) {
    return make(signer, audit, head, out, err);
}

enum result audit_seal_check(const struct store_audit_seal *seal, const char *authority,
                             char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err) {
    struct error why;
    enum result result = check(audit, seal, authority, out_signed_by, &why);
    return result == RESULT_OK ? result : fail(err, result, "the audit log: %s", why.text);
}

enum result exam_seal_make(const struct trace_signer *signer, const struct store_audit_head *head,
                           struct store_audit_seal *out, struct error *err) {
    return make(signer, exam, head, out, err);
}

enum result exam_seal_check(const struct store_audit_seal *seal, const char *authority,
                            char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err) {
    struct error why;
    enum result result = check(exam, seal, authority, out_signed_by, &why);
    return result == RESULT_OK
               ? result
               : fail(err, result, "exam %lld: %s", (long long)seal->head.entry, why.text);
}

// What was signed last, if anything was, must still be there.
static enum result check_signed(struct store *store, const char *authority,
                                struct store_audit_seal *out_seal, struct error *err) {
    char signed_by[TRACE_SIGNED_BY_MAX];
    enum result result = store_audit_seal(store, out_seal, err);
    if (result != RESULT_OK)
        return result == RESULT_MISSING ? RESULT_OK : result;
    result = audit_seal_check(out_seal, authority, signed_by, err);
    return result == RESULT_OK ? store_audit_has(store, &out_seal->head, err) : result;
}

enum result audit_seal_renew(struct store *store, const struct trace_signer *signer,
                             const char *authority, struct store_audit_head *out_head,
                             struct error *err) {
    struct store_audit_head kept;
    struct store_audit_seal before, seal;
    enum result result = check_signed(store, authority, &before, err);
    if (result == RESULT_OK)
        result = audit_head_check(store, authority, &kept, err);
    if (result == RESULT_OK)
        result = store_audit_head(store, out_head, err);
    if (result == RESULT_OK && out_head->entry != kept.entry)
        result = audit_head_keep(authority, out_head, err);
    if (result != RESULT_OK || out_head->entry == before.head.entry)
        return result;
    result = audit_seal_make(signer, out_head, &seal, err);
    return result == RESULT_OK ? store_put_audit_seal(store, &seal, err) : result;
}
