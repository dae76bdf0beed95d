#include "web/renewal.h"

#include "base/check.h"
#include "base/log.h"

#include <errno.h>
#include <openssl/ssl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// Which files they are; a path may be a link to another file each time. Changed is also what
// somebody may read now who could not before.
struct stamps {
    struct {
        int64_t file, size, changed_s, changed_ns;
    } of[2];
};

struct renewal {
    char *certificate, *key;
    struct stamps seen;
};

static struct stamps take_stamps(const struct renewal *r) {
    const char *const paths[2] = {r->certificate, r->key};
    struct stamps stamps = {0};
    for (int i = 0; i < 2; i++) {
        struct stat status = {0};
        stat(paths[i], &status); // what is not there has no size
        stamps.of[i].file = (int64_t)status.st_ino;
        stamps.of[i].size = (int64_t)status.st_size;
        stamps.of[i].changed_s = (int64_t)status.st_ctim.tv_sec;
        stamps.of[i].changed_ns = (int64_t)status.st_ctim.tv_nsec;
    }
    return stamps;
}

static enum result check_files(const struct renewal *r, struct error *err) {
    if (access(r->certificate, R_OK))
        return fail(err, RESULT_MISSING, "%s: %s", r->certificate, strerror(errno));
    if (access(r->key, R_OK))
        return fail(err, RESULT_MISSING, "%s: %s", r->key, strerror(errno));
    SSL_CTX *context = SSL_CTX_new(TLS_server_method());
    CHECK(context);
    bool good = SSL_CTX_use_certificate_chain_file(context, r->certificate) == 1 &&
                SSL_CTX_use_PrivateKey_file(context, r->key, SSL_FILETYPE_PEM) == 1;
    SSL_CTX_free(context);
    return good ? RESULT_OK
                : fail(err, RESULT_FORMAT, "%s: not the key of %s", r->key, r->certificate);
}

enum result renewal_create(const char *certificate, const char *key, struct renewal **out_renewal,
                           struct error *err) {
    struct renewal *r = alloc(1, sizeof *r);
    r->certificate = alloc_text(certificate);
    r->key = alloc_text(key);
    r->seen = take_stamps(r);
    enum result result = check_files(r, err);
    if (result != RESULT_OK)
        renewal_destroy(&r);
    *out_renewal = r;
    return result;
}

void renewal_destroy(struct renewal **renewal) {
    struct renewal *r = *renewal;
    if (!r)
        return;
    free(r->certificate);
    free(r->key);
    free(r);
    *renewal = NULL;
}

// Certificate and key are replaced one after the other: between the two they do not fit.
bool renewal_check(struct renewal *r, struct lws_context *context) {
    struct error err;
    struct stamps stamps = take_stamps(r);
    if (!memcmp(&stamps, &r->seen, sizeof stamps))
        return false;
    r->seen = stamps;
    if (check_files(r, &err) != RESULT_OK) {
        log_warning("web", "%s; the certificate stays the one before", err.text);
        return false;
    }
    lws_tls_cert_updated(context, r->certificate, r->key, NULL, 0, NULL, 0);
    log_info("web", "%s: taken anew", r->certificate);
    return true;
}
