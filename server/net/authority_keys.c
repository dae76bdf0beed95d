#include "net/authority_keys.h"

#include "base/check.h"
#include "net/authority_files.h"
#include "net/authority_secret.h"

#include <openssl/crypto.h>
#include <openssl/pem.h>
#include <stdio.h>

enum result authority_write_memory(const char *dir, const char *name, BIO *memory,
                                   struct error *err) {
    char *data;
    long size = BIO_get_mem_data(memory, &data);
    enum result result = authority_write(dir, name, data, (size_t)size, err);
    OPENSSL_cleanse(data, (size_t)size);
    BIO_free(memory);
    return result;
}

enum result authority_write_key(const char *dir, const char *name, EVP_PKEY *key,
                                struct error *err) {
    BIO *memory = BIO_new(BIO_s_secmem());
    NEED(memory, "memory");
    int written = PEM_write_bio_PrivateKey(memory, key, NULL, NULL, 0, NULL, NULL);
    NEED(written == 1, "memory");
    return authority_write_memory(dir, name, memory, err);
}

enum result authority_write_certificate(const char *dir, const char *name, X509 *certificate,
                                        struct error *err) {
    BIO *memory = BIO_new(BIO_s_mem());
    NEED(memory, "memory");
    int written = PEM_write_bio_X509(memory, certificate);
    NEED(written == 1, "memory");
    return authority_write_memory(dir, name, memory, err);
}

static FILE *open_in(const char *dir, const char *name) {
    char path[4096];
    int used = snprintf(path, sizeof path, "%s/%s", dir, name);
    return used < (int)sizeof path ? fopen(path, "re") : NULL;
}

X509 *authority_read_certificate(const char *dir, const char *name) {
    FILE *file = open_in(dir, name);
    X509 *certificate = file ? PEM_read_X509(file, NULL, NULL, NULL) : NULL;
    if (file)
        fclose(file);
    return certificate;
}

EVP_PKEY *authority_read_key(const char *dir, const char *name) {
    FILE *file = open_in(dir, name);
    EVP_PKEY *key = file ? PEM_read_PrivateKey(file, NULL, NULL, NULL) : NULL;
    if (file)
        fclose(file);
    return key;
}

void issuer_release(struct issuer *issuer) {
    X509_free(issuer->certificate);
    EVP_PKEY_free(issuer->key);
}

enum result issuer_read(const char *dir, struct issuer *out, struct error *err) {
    bool encrypted;
    *out = (struct issuer){.certificate = authority_read_certificate(dir, "authority.pem")};
    if (!out->certificate)
        return fail(err, RESULT_MISSING,
                    "%s: authority.pem or authority.key is missing or unreadable", dir);
    enum result result = authority_secret_read(dir, &out->key, &encrypted, err);
    if (result != RESULT_OK)
        return result;
    if (X509_check_private_key(out->certificate, out->key) != 1)
        return fail(err, RESULT_CORRUPT, "%s: authority.key is not the key of authority.pem", dir);
    return RESULT_OK;
}
