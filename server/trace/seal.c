#include "base/bytes.h"
#include "base/check.h"
#include "base/clock.h"
#include "trace/record.h"

#include <errno.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <stdio.h>
#include <string.h>

static const char text[] = "arthron trace, end";
_Static_assert(TRACE_SEAL_SIZE == sizeof text - 1 + TRACE_HASH_SIZE + 2 * sizeof(uint64_t), "text");

void seal_message(const uint8_t hash[TRACE_HASH_SIZE], uint64_t records, uint64_t missing,
                  uint8_t *out) {
    struct writer w = {out, TRACE_SEAL_SIZE, 0, false};
    write_bytes(&w, text, sizeof text - 1);
    write_bytes(&w, hash, TRACE_HASH_SIZE);
    write_u64(&w, records);
    write_u64(&w, missing);
    CHECK(!w.overflow && w.used == TRACE_SEAL_SIZE);
}

static enum result read_authority(const char *path, X509 **out, struct error *err) {
    FILE *file = fopen(path, "re");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    *out = PEM_read_X509(file, NULL, NULL, NULL);
    fclose(file);
    return *out ? RESULT_OK : fail(err, RESULT_IO, "%s: it holds no certificate", path);
}

// For a server: a station's certificate is the authority's, too, and signs no trace. At the
// session's start: years later the certificate may have run out, and the trace holds.
static bool was_given_by(X509 *certificate, X509 *authority, int64_t utc_ns) {
    X509_STORE *store = X509_STORE_new();
    X509_STORE_CTX *context = X509_STORE_CTX_new();
    NEED(store && context, "memory");
    bool good = X509_STORE_add_cert(store, authority) == 1 &&
                X509_STORE_CTX_init(context, store, certificate, NULL) == 1;
    if (good) {
        X509_STORE_CTX_set_time(context, 0, (time_t)(utc_ns / NS_PER_S));
        X509_STORE_CTX_set_purpose(context, X509_PURPOSE_SSL_SERVER);
        good = X509_verify_cert(context) == 1;
    }
    X509_STORE_CTX_free(context);
    X509_STORE_free(store);
    return good;
}

static enum result ask_authority(X509 *certificate, const char *path, int64_t utc_ns,
                                 struct error *err) {
    X509 *authority = NULL;
    enum result result = read_authority(path, &authority, err);
    if (result != RESULT_OK)
        return result;
    bool good = was_given_by(certificate, authority, utc_ns);
    X509_free(authority);
    return good ? RESULT_OK
                : fail(err, RESULT_REFUSED,
                       "the certificate in its end record was not issued to a server by %s, or was "
                       "not "
                       "valid at the session's start",
                       path);
}

static void name_of(const X509 *certificate, char out[TRACE_SIGNED_BY_MAX]) {
    char name[64] = "";
    BIGNUM *number = ASN1_INTEGER_to_BN(X509_get0_serialNumber(certificate), NULL);
    char *serial = number ? BN_bn2hex(number) : NULL;
    X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, name,
                              sizeof name);
    snprintf(out, TRACE_SIGNED_BY_MAX, "%s, certificate %.40s", name, serial ? serial : "");
    OPENSSL_free(serial);
    BN_free(number);
}

static bool signature_is_good(X509 *certificate, const struct trace_seal *seal) {
    EVP_MD_CTX *context = EVP_MD_CTX_new();
    NEED(context, "memory");
    bool good = EVP_DigestVerifyInit(context, NULL, EVP_sha256(), NULL,
                                     X509_get0_pubkey(certificate)) == 1 &&
                EVP_DigestVerify(context, seal->signature, seal->signature_size, seal->message,
                                 sizeof seal->message) == 1;
    EVP_MD_CTX_free(context);
    return good;
}

enum result trace_seal_check(const struct trace_seal *seal, const char *authority, int64_t utc_ns,
                             char out_signed_by[TRACE_SIGNED_BY_MAX], struct error *err) {
    const uint8_t *der = seal->certificate;
    X509 *certificate = d2i_X509(NULL, &der, (long)seal->certificate_size);
    if (!certificate)
        return fail(err, RESULT_FORMAT, "the certificate in its end record cannot be read");
    name_of(certificate, out_signed_by);
    enum result result = RESULT_OK;
    if (!signature_is_good(certificate, seal))
        result = fail(err, RESULT_REFUSED,
                      "its signature is wrong: the trace was changed after it was closed");
    if (result == RESULT_OK && authority)
        result = ask_authority(certificate, authority, utc_ns, err);
    X509_free(certificate);
    return result;
}
