#include "link/trust.h"

#include "base/check.h"
#include "link/link.h"

#include <errno.h>
#include <openssl/crypto.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static bool is_named_by(const struct code *code, X509 *certificate) {
    uint8_t fingerprint[CODE_FINGERPRINT_SIZE];
    uint8_t *der = NULL;
    int size = i2d_X509(certificate, &der);
    if (size <= 0)
        return false;
    code_fingerprint(der, (size_t)size, fingerprint);
    OPENSSL_free(der);
    return !CRYPTO_memcmp(fingerprint, code->fingerprint, sizeof fingerprint);
}

// The certificates of the server's chain that the code names: one, or none.
static STACK_OF(X509) * authorities(const struct code *code, X509_STORE_CTX *chain) {
    STACK_OF(X509) *shown = X509_STORE_CTX_get0_untrusted(chain);
    STACK_OF(X509) *named = sk_X509_new_null();
    CHECK(named);
    for (int i = 0; i < sk_X509_num(shown); i++)
        if (is_named_by(code, sk_X509_value(shown, i)))
            sk_X509_push(named, sk_X509_value(shown, i));
    return named;
}

static int keep_verdict(int good, X509_STORE_CTX *chain) {
    (void)chain;
    return good;
}

// Replaces libwebsockets' own callback, which finds its connection by an index that every new
// context of the process changes.
static int verify(X509_STORE_CTX *chain, void *argument) {
    struct trust *trust = argument;
    STACK_OF(X509) *named = trust->code ? authorities(trust->code, chain) : NULL;
    X509_STORE_CTX_set_verify_cb(chain, keep_verdict);
    if (named)
        X509_STORE_CTX_set0_trusted_stack(chain, named);
    int good = X509_verify_cert(chain);
    sk_X509_free(named);
    trust->problem[0] = '\0';
    if (good != 1)
        snprintf(trust->problem, sizeof trust->problem, "the server's certificate: %s",
                 X509_verify_cert_error_string(X509_STORE_CTX_get_error(chain)));
    return good == 1;
}

static enum result expect_host(SSL_CTX *context, const char *host, struct error *err) {
    X509_VERIFY_PARAM *expected = SSL_CTX_get0_param(context);
    X509_VERIFY_PARAM_set_hostflags(expected, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    if (host[0] && (X509_VERIFY_PARAM_set1_ip_asc(expected, host) == 1 ||
                    X509_VERIFY_PARAM_set1_host(expected, host, 0) == 1))
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "'%s' is no host name or address", host);
}

static enum result begin(struct trust *trust, const char *host, struct error *err) {
    trust->context = SSL_CTX_new(TLS_client_method());
    CHECK(trust->context);
    SSL_CTX_set_min_proto_version(trust->context, TLS1_3_VERSION);
    SSL_CTX_set_verify(trust->context, SSL_VERIFY_PEER, NULL);
    SSL_CTX_set_cert_verify_callback(trust->context, verify, trust);
    return expect_host(trust->context, host, err);
}

static enum result load_keys(SSL_CTX *context, const char *dir, struct error *err) {
    char authority[4096], certificate[4096], key[4096];
    snprintf(authority, sizeof authority, "%s/authority.pem", dir);
    snprintf(certificate, sizeof certificate, "%s/station.pem", dir);
    snprintf(key, sizeof key, "%s/station.key", dir);
    const char *const files[] = {authority, certificate, key};
    for (int i = 0; i < 3; i++)
        if (access(files[i], R_OK))
            return fail(err, RESULT_MISSING, "%s: %s", files[i], strerror(errno));
    if (SSL_CTX_load_verify_file(context, authority) != 1)
        return fail(err, RESULT_FORMAT, "%s: no certificate can be read", authority);
    if (SSL_CTX_use_certificate_chain_file(context, certificate) != 1)
        return fail(err, RESULT_FORMAT, "%s: no certificate can be read", certificate);
    if (SSL_CTX_use_PrivateKey_file(context, key, SSL_FILETYPE_PEM) != 1 ||
        SSL_CTX_check_private_key(context) != 1)
        return fail(err, RESULT_FORMAT, "%s: not the key of %s", key, certificate);
    return RESULT_OK;
}

enum result trust_init(struct trust *trust, const char *keys_dir, const char *host,
                       struct error *err) {
    *trust = (struct trust){0};
    enum result result = begin(trust, host, err);
    if (result == RESULT_OK)
        result = load_keys(trust->context, keys_dir, err);
    if (result != RESULT_OK)
        trust_fini(trust);
    return result;
}

enum result trust_init_code(struct trust *trust, const struct code *code, const char *host,
                            struct error *err) {
    *trust = (struct trust){.code = code};
    enum result result = begin(trust, host, err);
    if (result != RESULT_OK)
        trust_fini(trust);
    return result;
}

void trust_fini(struct trust *trust) {
    SSL_CTX_free(trust->context);
    trust->context = NULL;
}

enum result link_certificate_end(const char *keys_dir, int64_t *out_utc_s, struct error *err) {
    char path[4096];
    snprintf(path, sizeof path, "%s/station.pem", keys_dir);
    FILE *file = fopen(path, "re");
    if (!file)
        return fail(err, RESULT_MISSING, "%s: %s", path, strerror(errno));
    X509 *certificate = PEM_read_X509(file, NULL, NULL, NULL);
    fclose(file);
    struct tm end;
    bool read = certificate && ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &end) == 1;
    X509_free(certificate);
    if (!read)
        return fail(err, RESULT_FORMAT, "%s: no certificate can be read", path);
    *out_utc_s = timegm(&end);
    return RESULT_OK;
}
