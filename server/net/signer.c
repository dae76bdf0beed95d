#include "net/signer.h"

#include "base/check.h"

#include <errno.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct signer {
    EVP_PKEY *key;
    X509 *certificate;
    uint8_t *der;
    int der_size;
};

static FILE *open_in(const char *dir, const char *name, struct error *err) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *file = fopen(path, "re");
    if (!file)
        fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return file;
}

static enum result read_key(const char *dir, struct signer *s, struct error *err) {
    FILE *file = open_in(dir, "server.key", err);
    if (!file)
        return RESULT_IO;
    s->key = PEM_read_PrivateKey(file, NULL, NULL, NULL);
    fclose(file);
    return s->key ? RESULT_OK : fail(err, RESULT_FORMAT, "%s/server.key: it holds no key", dir);
}

static enum result read_certificate(const char *dir, struct signer *s, struct error *err) {
    FILE *file = open_in(dir, "server.pem", err);
    if (!file)
        return RESULT_IO;
    s->certificate = PEM_read_X509(file, NULL, NULL, NULL);
    fclose(file);
    s->der_size = s->certificate ? i2d_X509(s->certificate, &s->der) : -1;
    if (s->der_size < 0)
        return fail(err, RESULT_FORMAT, "%s/server.pem: it holds no certificate", dir);
    if (X509_check_private_key(s->certificate, s->key) != 1)
        return fail(err, RESULT_INVALID, "%s: server.pem is not of server.key", dir);
    return RESULT_OK;
}

enum result signer_create(const char *dir, struct signer **out_signer, struct error *err) {
    struct signer *s = alloc(1, sizeof *s);
    enum result result = read_key(dir, s, err);
    if (result == RESULT_OK)
        result = read_certificate(dir, s, err);
    if (result != RESULT_OK)
        signer_destroy(&s);
    *out_signer = s;
    return result;
}

void signer_destroy(struct signer **signer) {
    struct signer *s = *signer;
    if (!s)
        return;
    EVP_PKEY_free(s->key);
    X509_free(s->certificate);
    OPENSSL_free(s->der);
    free(s);
    *signer = NULL;
}

const uint8_t *signer_certificate(const struct signer *s, size_t *out_size) {
    *out_size = (size_t)s->der_size;
    return s->der;
}

bool signer_sign(void *signer, const uint8_t *message, size_t size, uint8_t *out, size_t *in_out) {
    struct signer *s = signer;
    EVP_MD_CTX *context = EVP_MD_CTX_new();
    CHECK(context);
    bool done = EVP_DigestSignInit(context, NULL, EVP_sha256(), NULL, s->key) == 1 &&
                EVP_DigestSign(context, out, in_out, message, size) == 1;
    EVP_MD_CTX_free(context);
    return done;
}
