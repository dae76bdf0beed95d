#include "net/certificate.h"

#include "base/check.h"

#include <arpa/inet.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/x509v3.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define DAY_S INT64_C(86400)
#define CLOCKS_DIFFER_S DAY_S // a station's clock may be behind

EVP_PKEY *certificate_key(void) {
    EVP_PKEY *key = EVP_EC_gen("P-256");
    NEED(key, "memory");
    return key;
}

static void set_serial(X509 *certificate) {
    BIGNUM *number = BN_new();
    int made = BN_rand(number, 128, BN_RAND_TOP_ONE, BN_RAND_BOTTOM_ANY);
    NEED(made == 1, "memory");
    ASN1_INTEGER *set = BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate));
    NEED(set, "memory");
    BN_free(number);
}

static void set_subject(X509 *certificate, const char *common_name) {
    X509_NAME *name = X509_get_subject_name(certificate);
    int added = X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_UTF8,
                                           (const unsigned char *)common_name, -1, -1, 0);
    NEED(added == 1, "memory");
}

static void extend(X509 *certificate, X509V3_CTX *context, int nid, const char *value) {
    X509_EXTENSION *extension = X509V3_EXT_conf_nid(NULL, context, nid, value);
    NEED(extension, "memory");
    int added = X509_add_ext(certificate, extension, -1);
    NEED(added == 1, "memory");
    X509_EXTENSION_free(extension);
}

static void extend_for(enum certificate_use use, const char *alternative_names, X509 *certificate,
                       X509 *issuer) {
    X509V3_CTX context;
    X509V3_set_ctx(&context, issuer, certificate, NULL, NULL, 0);
    bool authority = use == CERTIFICATE_AUTHORITY;
    extend(certificate, &context, NID_basic_constraints,
           authority ? "critical,CA:TRUE,pathlen:0" : "critical,CA:FALSE");
    extend(certificate, &context, NID_key_usage,
           authority ? "critical,keyCertSign,cRLSign" : "critical,digitalSignature");
    if (!authority)
        extend(certificate, &context, NID_ext_key_usage,
               use == CERTIFICATE_SERVER ? "serverAuth" : "clientAuth");
    if (alternative_names)
        extend(certificate, &context, NID_subject_alt_name, alternative_names);
    extend(certificate, &context, NID_subject_key_identifier, "hash");
    extend(certificate, &context, NID_authority_key_identifier, "keyid:always");
}

X509 *certificate_make(enum certificate_use use, const char *common_name,
                       const char *alternative_names, EVP_PKEY *key, const struct issuer *issuer) {
    X509 *certificate = X509_new();
    NEED(certificate, "memory");
    X509_set_version(certificate, X509_VERSION_3);
    set_serial(certificate);
    long days = use == CERTIFICATE_AUTHORITY ? CERTIFICATE_AUTHORITY_DAYS : CERTIFICATE_DAYS;
    X509_gmtime_adj(X509_getm_notBefore(certificate), -CLOCKS_DIFFER_S);
    X509_gmtime_adj(X509_getm_notAfter(certificate), days * DAY_S);
    if (issuer && ASN1_TIME_compare(X509_get0_notAfter(certificate),
                                    X509_get0_notAfter(issuer->certificate)) > 0)
        X509_set1_notAfter(certificate, X509_get0_notAfter(issuer->certificate));
    set_subject(certificate, common_name);
    X509 *by = issuer ? issuer->certificate : certificate;
    X509_set_issuer_name(certificate, X509_get_subject_name(by));
    X509_set_pubkey(certificate, key);
    extend_for(use, alternative_names, certificate, by);
    int size = X509_sign(certificate, issuer ? issuer->key : key, EVP_sha256());
    NEED(size > 0, "memory");
    return certificate;
}

static bool is_p256(const EVP_PKEY *key) {
    char group[32];
    size_t size;
    return key && EVP_PKEY_get_base_id(key) == EVP_PKEY_EC &&
           EVP_PKEY_get_group_name(key, group, sizeof group, &size) == 1 &&
           !strcmp(group, SN_X9_62_prime256v1);
}

EVP_PKEY *certificate_request_key(const uint8_t *request_der, size_t size,
                                  char out_name[CERTIFICATE_NAME_SIZE]) {
    const unsigned char *next = request_der;
    X509_REQ *request = d2i_X509_REQ(NULL, &next, (long)size);
    bool whole = request && next == request_der + size;
    EVP_PKEY *key = whole ? X509_REQ_get_pubkey(request) : NULL;
    out_name[0] = '\0';
    if (whole)
        X509_NAME_get_text_by_NID(X509_REQ_get_subject_name(request), NID_commonName, out_name,
                                  CERTIFICATE_NAME_SIZE);
    if (!is_p256(key) || X509_REQ_verify(request, key) != 1) {
        EVP_PKEY_free(key);
        key = NULL;
    }
    X509_REQ_free(request);
    return key;
}

int64_t certificate_end(const X509 *certificate) {
    struct tm end;
    return ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &end) == 1 ? timegm(&end) : 0;
}

// False: a kind of name that is none of a host, or too long.
static bool read_host(const GENERAL_NAME *name, char out[256]) {
    if (name->type == GEN_DNS) {
        const ASN1_IA5STRING *text = name->d.dNSName;
        int size = ASN1_STRING_length(text);
        snprintf(out, 256, "%.*s", size, (const char *)ASN1_STRING_get0_data(text));
        return size > 0 && size < 256 && strlen(out) == (size_t)size;
    }
    if (name->type != GEN_IPADD)
        return false;
    const ASN1_OCTET_STRING *address = name->d.iPAddress;
    int family = ASN1_STRING_length(address) == 4 ? AF_INET : AF_INET6;
    return (family == AF_INET || ASN1_STRING_length(address) == 16) &&
           inet_ntop(family, ASN1_STRING_get0_data(address), out, 256);
}

int certificate_hosts(const X509 *certificate, char (*out_hosts)[256], int max) {
    GENERAL_NAMES *names = X509_get_ext_d2i(certificate, NID_subject_alt_name, NULL, NULL);
    int count = 0;
    for (int i = 0; i < sk_GENERAL_NAME_num(names) && count < max; i++)
        count += read_host(sk_GENERAL_NAME_value(names, i), out_hosts[count]);
    GENERAL_NAMES_free(names);
    return count;
}

void certificate_serial(const X509 *certificate, char out_hex[CERTIFICATE_SERIAL_SIZE]) {
    BIGNUM *number = ASN1_INTEGER_to_BN(X509_get0_serialNumber(certificate), NULL);
    char *text = number ? BN_bn2hex(number) : NULL;
    NEED(text, "memory");
    CHECK(strlen(text) < CERTIFICATE_SERIAL_SIZE);
    strcpy(out_hex, text);
    OPENSSL_free(text);
    BN_free(number);
}
