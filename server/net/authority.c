#include "net/authority.h"

#include "base/check.h"
#include "base/clock.h"
#include "net/authority_files.h"
#include "net/authority_keys.h"
#include "net/authority_secret.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define HOST_NAME_MAX_LENGTH 253
#define STATION_NAME_MAX_LENGTH 63
#define SERVER_NAME "Arthron server"
#define NAMES_SIZE (AUTHORITY_HOSTS_MAX * (HOST_NAME_MAX_LENGTH + 8))

_Static_assert(HOST_NAME_MAX_LENGTH < AUTHORITY_HOST_SIZE, "a host's name fits");

static bool consists_of(const char *text, const char *extra, size_t longest) {
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";
    size_t size = strlen(text);
    for (size_t i = 0; i < size; i++)
        if (!strchr(letters, text[i]) && !strchr(extra, text[i]))
            return false;
    return size > 0 && size <= longest;
}

bool authority_name_is_valid(const char *station) {
    return consists_of(station, "-_.", STATION_NAME_MAX_LENGTH);
}

// ---- init ---------------------------------------------------------------------------------------

static bool is_address(const char *host) {
    uint8_t bytes[sizeof(struct in6_addr)];
    return inet_pton(AF_INET, host, bytes) == 1 || inet_pton(AF_INET6, host, bytes) == 1;
}

static enum result alternative_names(const char *const *hosts, int count, char *out, size_t size,
                                     struct error *err) {
    if (count < 1 || count > AUTHORITY_HOSTS_MAX)
        return fail(err, RESULT_INVALID, "give 1 to %d host names, not %d", AUTHORITY_HOSTS_MAX,
                    count);
    size_t used = 0;
    for (int i = 0; i < count; i++) {
        bool address = is_address(hosts[i]);
        if (!address && !consists_of(hosts[i], "-_.", HOST_NAME_MAX_LENGTH))
            return fail(err, RESULT_INVALID, "host %d is not a host name or an address", i + 1);
        used += (size_t)snprintf(out + used, size - used, "%s%s:%s", i ? "," : "",
                                 address ? "IP" : "DNS", hosts[i]);
        CHECK(used < size);
    }
    return RESULT_OK;
}

static bool has_authority(const char *dir) {
    char path[4096];
    int used = snprintf(path, sizeof path, "%s/authority.pem", dir);
    return used < (int)sizeof path && access(path, F_OK) == 0;
}

static enum result make_folder(const char *dir, struct error *err) {
    if (mkdir(dir, 0700) && errno != EEXIST)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    if (chmod(dir, 0700))
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    return RESULT_OK;
}

// The authority's certificate comes last: while it is not there, init may be tried again.
static enum result make_all(const char *dir, const char *names, struct error *err) {
    struct issuer authority = {.key = certificate_key()};
    authority.certificate =
        certificate_make(CERTIFICATE_AUTHORITY, "Arthron authority", NULL, authority.key, NULL);
    EVP_PKEY *key = certificate_key();
    X509 *server = certificate_make(CERTIFICATE_SERVER, SERVER_NAME, names, key, &authority);
    enum result result = authority_write_key(dir, "server.key", key, err);
    if (result == RESULT_OK)
        result = authority_write_certificate(dir, "server.pem", server, err);
    if (result == RESULT_OK)
        result = authority_secret_write(dir, authority.key, err);
    if (result == RESULT_OK)
        result = authority_write_certificate(dir, "authority.pem", authority.certificate, err);
    X509_free(server);
    EVP_PKEY_free(key);
    issuer_release(&authority);
    return result;
}

enum result authority_init(const char *dir, const char *const *hosts, int host_count,
                           struct error *err) {
    char names[NAMES_SIZE];
    enum result result = alternative_names(hosts, host_count, names, sizeof names, err);
    int lock;
    if (result == RESULT_OK)
        result = make_folder(dir, err);
    if (result == RESULT_OK)
        result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    if (has_authority(dir))
        result = fail(err, RESULT_REFUSED, "%s: there is an authority already", dir);
    else
        result = make_all(dir, names, err);
    close(lock);
    return result;
}

// ---- the server's certificate -------------------------------------------------------------------

static enum result describe(const char *dir, X509 *certificate, struct authority_server *out,
                            struct error *err) {
    *out = (struct authority_server){.until_utc_s = certificate_end(certificate)};
    out->host_count = certificate_hosts(certificate, out->hosts, AUTHORITY_HOSTS_MAX);
    return out->host_count ? RESULT_OK
                           : fail(err, RESULT_CORRUPT, "%s/server.pem names no host", dir);
}

enum result authority_server(const char *dir, struct authority_server *out, struct error *err) {
    X509 *certificate = authority_read_certificate(dir, "server.pem");
    *out = (struct authority_server){0};
    if (!certificate)
        return fail(err, RESULT_MISSING, "%s: server.pem is missing or unreadable", dir);
    enum result result = describe(dir, certificate, out, err);
    X509_free(certificate);
    return result;
}

int64_t authority_certificate_end(const char *dir, const char *name) {
    X509 *certificate = authority_read_certificate(dir, name);
    int64_t end_s = certificate ? certificate_end(certificate) : 0;
    X509_free(certificate);
    return end_s;
}

// The names of the hosts given, or of the present certificate where none is.
static enum result names_to_renew(const char *dir, const char *const *hosts, int count,
                                  char out_names[NAMES_SIZE], struct error *err) {
    struct authority_server before;
    const char *names[AUTHORITY_HOSTS_MAX];
    if (count)
        return alternative_names(hosts, count, out_names, NAMES_SIZE, err);
    enum result result = authority_server(dir, &before, err);
    if (result != RESULT_OK)
        return result;
    for (int i = 0; i < before.host_count; i++)
        names[i] = before.hosts[i];
    return alternative_names(names, before.host_count, out_names, NAMES_SIZE, err);
}

// The key stays: one file is replaced, and at no moment do key and certificate not fit each other.
static enum result renew(const char *dir, const char *names, struct authority_server *out,
                         struct error *err) {
    struct issuer authority;
    EVP_PKEY *key = authority_read_key(dir, "server.key");
    X509 *certificate = NULL;
    enum result result = issuer_read(dir, &authority, err);
    if (result == RESULT_OK && !key)
        result = fail(err, RESULT_MISSING, "%s: server.key is missing or unreadable", dir);
    if (result == RESULT_OK) {
        certificate = certificate_make(CERTIFICATE_SERVER, SERVER_NAME, names, key, &authority);
        result = describe(dir, certificate, out, err);
    }
    if (result == RESULT_OK)
        result = authority_write_certificate(dir, "server.pem", certificate, err);
    X509_free(certificate);
    EVP_PKEY_free(key);
    issuer_release(&authority);
    return result;
}

enum result authority_renew_server(const char *dir, const char *const *hosts, int host_count,
                                   struct authority_server *out, struct error *err) {
    char names[NAMES_SIZE];
    int lock;
    enum result result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    result = names_to_renew(dir, hosts, host_count, names, err);
    if (result == RESULT_OK)
        result = renew(dir, names, out, err);
    close(lock);
    return result;
}
