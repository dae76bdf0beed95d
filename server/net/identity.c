#include "net/identity.h"

#include "net/certificate.h"

#include <openssl/bn.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <stdio.h>
#include <string.h>

static bool read_name(const X509 *certificate, char *out, int size) {
    X509_NAME *subject = X509_get_subject_name(certificate);
    int length = X509_NAME_get_text_by_NID(subject, NID_commonName, NULL, 0);
    return length > 0 && length < size &&
           X509_NAME_get_text_by_NID(subject, NID_commonName, out, size) == length &&
           strlen(out) == (size_t)length;
}

static bool read_serial(const X509 *certificate, char *out, size_t size) {
    BIGNUM *number = ASN1_INTEGER_to_BN(X509_get0_serialNumber(certificate), NULL);
    char *text = number ? BN_bn2hex(number) : NULL;
    bool fits = text && strlen(text) < size;
    if (fits)
        strcpy(out, text);
    OPENSSL_free(text);
    BN_free(number);
    return fits;
}

void identity_of(const SSL *connection, struct identity *out) {
    *out = (struct identity){0};
    const X509 *certificate = connection ? SSL_get0_peer_certificate(connection) : NULL;
    out->certified = certificate && SSL_get_verify_result(connection) == X509_V_OK &&
                     read_name(certificate, out->name, sizeof out->name) &&
                     read_serial(certificate, out->serial, sizeof out->serial);
    out->until_s = certificate ? certificate_end(certificate) : 0;
}

static int on_verified(int good, X509_STORE_CTX *store) {
    if (!good) {
        SSL *connection = X509_STORE_CTX_get_ex_data(store, SSL_get_ex_data_X509_STORE_CTX_idx());
        atomic_uint_fast64_t *refused = SSL_CTX_get_app_data(SSL_get_SSL_CTX(connection));
        atomic_fetch_add(refused, 1);
    }
    return good;
}

// Replaces libwebsockets' own check, which asks the application and believes it even against
// OpenSSL.
void identity_ask(SSL_CTX *context, atomic_uint_fast64_t *refused) {
    SSL_CTX_set_min_proto_version(context, TLS1_3_VERSION);
    SSL_CTX_set_num_tickets(context, 0);
    SSL_CTX_set_app_data(context, refused);
    SSL_CTX_set_verify(context, SSL_VERIFY_PEER, on_verified);
}
