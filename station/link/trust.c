#include "link/trust.h"

#include "base/check.h"
#include "link/certificate.h"
#include "link/key_files.h"

#include <openssl/crypto.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

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
    NEED(named, "memory");
    for (int i = 0; i < sk_X509_num(shown); i++)
        if (is_named_by(code, sk_X509_value(shown, i)))
            sk_X509_push(named, sk_X509_value(shown, i));
    return named;
}

static int64_t seconds_of(const ASN1_TIME *time) {
    struct tm utc;
    return ASN1_TIME_to_tm(time, &utc) == 1 ? timegm(&utc) : 0;
}

static int64_t end_of(const X509 *certificate) {
    return certificate ? seconds_of(X509_get0_notAfter(certificate)) : 0;
}

static void write_date(int64_t utc_s, char out[32]) {
    time_t seconds = (time_t)utc_s;
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(out, 32, "%Y-%m-%d %H:%M UTC", &utc);
}

static void explain_time(struct trust *trust, const X509 *certificate, bool ended) {
    char limit[32], now[32];
    int64_t limit_s = certificate ? seconds_of(ended ? X509_get0_notAfter(certificate)
                                                     : X509_get0_notBefore(certificate))
                                  : 0;
    write_date(limit_s, limit);
    write_date(time(NULL), now);
    trust->clock_is_wrong = true;
    snprintf(
        trust->problem, sizeof trust->problem,
        ended
            ? "the server's certificate ended at %s; this machine's clock says %s. Set the clock "
              "if it is wrong, else renew the certificate"
            : "the server's certificate begins at %s; this machine's clock says %s. Set the clock",
        limit, now);
}

static void explain(struct trust *trust, X509_STORE_CTX *chain) {
    int code = X509_STORE_CTX_get_error(chain);
    switch (code) {
    case X509_V_ERR_CERT_NOT_YET_VALID:
    case X509_V_ERR_CERT_HAS_EXPIRED:
        explain_time(trust, X509_STORE_CTX_get_current_cert(chain),
                     code == X509_V_ERR_CERT_HAS_EXPIRED);
        break;
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
        snprintf(trust->problem, sizeof trust->problem,
                 "the server's certificate is not for %.100s. Use another name of the server, or "
                 "add this one to its certificate (arthron-server keys renew)",
                 trust->host);
        break;
    default:
        snprintf(trust->problem, sizeof trust->problem,
                 "the server's certificate is not trusted: %s. Enrol the station again if server "
                 "or authority is new",
                 X509_verify_cert_error_string(code));
    }
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
    trust->clock_is_wrong = false;
    if (good == 1)
        atomic_store(&trust->server_until_s, end_of(X509_STORE_CTX_get0_cert(chain)));
    else
        explain(trust, chain);
    return good == 1;
}

enum result trust_expect(struct trust *trust, const char *host, struct error *err) {
    X509_VERIFY_PARAM *expected = SSL_CTX_get0_param(trust->context);
    trust->host = host;
    X509_VERIFY_PARAM_set1_ip(expected, NULL, 0);
    X509_VERIFY_PARAM_set1_host(expected, NULL, 0);
    if (host[0] && (X509_VERIFY_PARAM_set1_ip_asc(expected, host) == 1 ||
                    X509_VERIFY_PARAM_set1_host(expected, host, 0) == 1))
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "'%s' is neither a host name nor an address", host);
}

static void begin_trust(struct trust *trust) {
    trust->context = SSL_CTX_new(TLS_client_method());
    NEED(trust->context, "memory");
    SSL_CTX_set_min_proto_version(trust->context, TLS1_3_VERSION);
    SSL_CTX_set_verify(trust->context, SSL_VERIFY_PEER, NULL);
    SSL_CTX_set_cert_verify_callback(trust->context, verify, trust);
    X509_VERIFY_PARAM_set_hostflags(SSL_CTX_get0_param(trust->context),
                                    X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
}

static enum result load_keys(SSL_CTX *context, const struct key_files *files, struct error *err) {
    SSL_CTX_set_cert_store(context, X509_STORE_new());
    if (SSL_CTX_load_verify_file(context, files->authority) != 1)
        return fail(err, RESULT_FORMAT, "%s: no certificate can be read", files->authority);
    if (SSL_CTX_use_certificate_chain_file(context, files->certificate) != 1)
        return fail(err, RESULT_FORMAT, "%s: no certificate can be read", files->certificate);
    if (SSL_CTX_use_PrivateKey_file(context, files->key, SSL_FILETYPE_PEM) != 1 ||
        SSL_CTX_check_private_key(context) != 1)
        return fail(err, RESULT_FORMAT, "%s is not the key of %s", files->key, files->certificate);
    return RESULT_OK;
}

enum result trust_init(struct trust *trust, const char *keys_dir, struct error *err) {
    *trust = (struct trust){0};
    struct key_files files;
    begin_trust(trust);
    enum result result = key_files_find(keys_dir, &files, err);
    if (result == RESULT_OK)
        result = load_keys(trust->context, &files, err);
    if (result != RESULT_OK)
        trust_fini(trust);
    return result;
}

enum result trust_check(const char *keys_dir, struct error *err) {
    struct trust trust;
    enum result result = trust_init(&trust, keys_dir, err);
    trust_fini(&trust);
    return result;
}

enum result trust_renew(struct trust *trust, const char *keys_dir, struct error *err) {
    struct key_files files;
    enum result result = trust_check(keys_dir, err);
    if (result == RESULT_OK)
        result = key_files_find(keys_dir, &files, err);
    return result == RESULT_OK ? load_keys(trust->context, &files, err) : result;
}

void trust_init_code(struct trust *trust, const struct code *code) {
    *trust = (struct trust){.code = code};
    begin_trust(trust);
}

void trust_fini(struct trust *trust) {
    SSL_CTX_free(trust->context);
    trust->context = NULL;
}

enum result link_certificate_times(const char *keys_dir, int64_t *out_from_s, int64_t *out_until_s,
                                   struct error *err) {
    struct key_files files;
    enum result result = key_files_find(keys_dir, &files, err);
    if (result != RESULT_OK)
        return result;
    FILE *file = fopen(files.certificate, "re");
    X509 *certificate = file ? PEM_read_X509(file, NULL, NULL, NULL) : NULL;
    if (file)
        fclose(file);
    *out_until_s = end_of(certificate);
    *out_from_s = certificate ? seconds_of(X509_get0_notBefore(certificate)) : 0;
    X509_free(certificate);
    return *out_until_s
               ? RESULT_OK
               : fail(err, RESULT_FORMAT, "%s: no certificate can be read", files.certificate);
}
