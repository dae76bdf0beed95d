#include "net/signer.h"

#include "base/check.h"
#include "websocket/tls_files.h"

#include <openssl/evp.h>
#include <openssl/x509.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

struct signer {
    pthread_mutex_t lock;
    struct tls_files *files;
    struct tls_credentials *credentials;
};

enum result signer_create(const char *dir, struct signer **out_signer, struct error *err) {
    char certificate[4096], key[4096];
    struct signer *s = alloc(1, sizeof *s);
    snprintf(certificate, sizeof certificate, "%s/server.pem", dir);
    snprintf(key, sizeof key, "%s/server.key", dir);
    pthread_mutex_init(&s->lock, NULL);
    enum result result = tls_files_create(certificate, key, &s->files, &s->credentials, err);
    if (result != RESULT_OK)
        signer_destroy(&s);
    *out_signer = s;
    return result;
}

void signer_destroy(struct signer **signer) {
    struct signer *s = *signer;
    if (!s)
        return;
    tls_credentials_destroy(&s->credentials);
    tls_files_destroy(&s->files);
    pthread_mutex_destroy(&s->lock);
    free(s);
    *signer = NULL;
}

static bool copy_certificate(X509 *certificate, uint8_t *out, size_t *in_out_size) {
    int size = i2d_X509(certificate, NULL);
    bool fits = size > 0 && (size_t)size <= *in_out_size;
    if (fits)
        *in_out_size = (size_t)i2d_X509(certificate, &out);
    return fits;
}

static bool sign(EVP_PKEY *key, const uint8_t *message, size_t size, uint8_t *out, size_t *in_out) {
    EVP_MD_CTX *context = EVP_MD_CTX_new();
    NEED(context, "memory");
    bool done = EVP_DigestSignInit(context, NULL, EVP_sha256(), NULL, key) == 1 &&
                EVP_DigestSign(context, out, in_out, message, size) == 1;
    EVP_MD_CTX_free(context);
    return done;
}

bool signer_sign(void *signer, const uint8_t *message, size_t size, uint8_t *out_certificate,
                 size_t *in_out_certificate_size, uint8_t *out_signature,
                 size_t *in_out_signature_size) {
    struct signer *s = signer;
    pthread_mutex_lock(&s->lock);
    struct tls_credentials *renewed = tls_files_look(s->files);
    if (renewed) {
        tls_credentials_destroy(&s->credentials);
        s->credentials = renewed;
    }
    bool done = copy_certificate(tls_credentials_certificate(s->credentials), out_certificate,
                                 in_out_certificate_size) &&
                sign(tls_credentials_key(s->credentials), message, size, out_signature,
                     in_out_signature_size);
    pthread_mutex_unlock(&s->lock);
    return done;
}
