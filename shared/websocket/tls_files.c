#include "websocket/tls_files.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <errno.h>
#include <openssl/ssl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define DAY_S 86400

// Which files they are; a path may be a link to another file each time. Changed is also what
// somebody may read now who could not before.
struct stamps {
    struct {
        int64_t device, file, size, changed_s, changed_ns;
    } of[2];
};

struct tls_credentials {
    X509 *certificate;
    STACK_OF(X509) * chain;
    EVP_PKEY *key;
};

struct tls_files {
    char *certificate, *key;
    struct stamps looked_at;
    int64_t end_s;    // of the certificate; seconds since 1970
    int64_t warned_s; // the last warning
};

// ---- credentials --------------------------------------------------------------------------------

static struct tls_credentials *credentials_of(SSL_CTX *context) {
    struct tls_credentials *c = alloc(1, sizeof *c);
    STACK_OF(X509) *chain = NULL;
    SSL_CTX_get0_chain_certs(context, &chain);
    c->certificate = SSL_CTX_get0_certificate(context);
    c->key = SSL_CTX_get0_privatekey(context);
    X509_up_ref(c->certificate);
    EVP_PKEY_up_ref(c->key);
    c->chain = chain ? X509_chain_up_ref(chain) : NULL;
    return c;
}

void tls_credentials_destroy(struct tls_credentials **credentials) {
    struct tls_credentials *c = *credentials;
    if (!c)
        return;
    X509_free(c->certificate);
    sk_X509_pop_free(c->chain, X509_free);
    EVP_PKEY_free(c->key);
    free(c);
    *credentials = NULL;
}

void tls_credentials_use(const struct tls_credentials *c, SSL_CTX *context) {
    int used = SSL_CTX_use_cert_and_key(context, c->certificate, c->key, c->chain, 1);
    CHECK(used == 1); // they fit each other
}

X509 *tls_credentials_certificate(const struct tls_credentials *c) {
    return c->certificate;
}

EVP_PKEY *tls_credentials_key(const struct tls_credentials *c) {
    return c->key;
}

// ---- files --------------------------------------------------------------------------------------

static struct stamps take_stamps(const struct tls_files *files) {
    const char *const paths[2] = {files->certificate, files->key};
    struct stamps stamps;
    memset(&stamps, 0, sizeof stamps);
    for (int i = 0; i < 2; i++) {
        struct stat status = {0};
        stat(paths[i], &status); // what is not there has no size
        stamps.of[i].device = (int64_t)status.st_dev;
        stamps.of[i].file = (int64_t)status.st_ino;
        stamps.of[i].size = (int64_t)status.st_size;
        stamps.of[i].changed_s = (int64_t)status.st_ctim.tv_sec;
        stamps.of[i].changed_ns = (int64_t)status.st_ctim.tv_nsec;
    }
    return stamps;
}

static enum result read_files(const struct tls_files *files, struct tls_credentials **out,
                              struct error *err) {
    const char *certificate = files->certificate, *key = files->key;
    if (access(certificate, R_OK))
        return fail(err, RESULT_MISSING, "%s: %s", certificate, strerror(errno));
    if (access(key, R_OK))
        return fail(err, RESULT_MISSING, "%s: %s", key, strerror(errno));
    SSL_CTX *context = SSL_CTX_new(TLS_server_method());
    NEED(context, "memory");
    enum result result = RESULT_OK;
    if (SSL_CTX_use_certificate_chain_file(context, certificate) != 1)
        result = fail(err, RESULT_FORMAT, "%s: no certificate can be read", certificate);
    else if (SSL_CTX_use_PrivateKey_file(context, key, SSL_FILETYPE_PEM) != 1)
        result = fail(err, RESULT_FORMAT, "%s is not the key of %s", key, certificate);
    else
        *out = credentials_of(context);
    SSL_CTX_free(context);
    return result;
}

static int64_t end_of(const struct tls_credentials *c) {
    struct tm end;
    return ASN1_TIME_to_tm(X509_get0_notAfter(c->certificate), &end) == 1 ? timegm(&end) : 0;
}

enum result tls_files_create(const char *certificate, const char *key, struct tls_files **out_files,
                             struct tls_credentials **out_credentials, struct error *err) {
    struct tls_files *files = alloc(1, sizeof *files);
    struct tls_credentials *credentials = NULL;
    files->certificate = alloc_text(certificate);
    files->key = alloc_text(key);
    files->looked_at = take_stamps(files);
    enum result result = read_files(files, &credentials, err);
    if (result == RESULT_OK)
        files->end_s = end_of(credentials);
    else
        tls_files_destroy(&files);
    if (out_credentials)
        *out_credentials = credentials;
    else
        tls_credentials_destroy(&credentials);
    *out_files = files;
    return result;
}

void tls_files_destroy(struct tls_files **files) {
    struct tls_files *f = *files;
    if (!f)
        return;
    free(f->certificate);
    free(f->key);
    free(f);
    *files = NULL;
}

// ---- looking ------------------------------------------------------------------------------------

// Certificate and key may be replaced one after the other: between the two they do not fit.
struct tls_credentials *tls_files_look(struct tls_files *files) {
    struct tls_credentials *credentials = NULL;
    struct error err;
    struct stamps stamps = take_stamps(files);
    if (!memcmp(&stamps, &files->looked_at, sizeof stamps))
        return NULL;
    files->looked_at = stamps;
    if (read_files(files, &credentials, &err) != RESULT_OK) {
        log_warning("tls", "%s; keeping the previous certificate", err.text);
        return NULL;
    }
    files->end_s = end_of(credentials);
    files->warned_s = 0;
    return credentials;
}

int64_t tls_files_end_s(const struct tls_files *files) {
    return files->end_s;
}

void tls_files_warn(struct tls_files *files, const char *room, const char *advice) {
    int64_t now_s = clock_utc_ns() / NS_PER_S, left_s = files->end_s - now_s;
    if (left_s >= TLS_WARNING_DAYS * DAY_S || now_s - files->warned_s < DAY_S)
        return;
    files->warned_s = now_s;
    if (left_s < 0)
        log_error(room, "%s ended %d days ago, nobody can connect: %s", files->certificate,
                  (int)(-left_s / DAY_S), advice);
    else
        log_warning(room, "%s ends in %d days: %s", files->certificate, (int)(left_s / DAY_S),
                    advice);
}
