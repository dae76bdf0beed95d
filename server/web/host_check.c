#include "web/host_check.h"

#include "base/check.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NAMES_MAX 16
#define NAME_MAX_LENGTH 256

struct host_check {
    char *path;
    X509 *certificate; // NULL: no TLS
    char *names[NAMES_MAX];
    int name_count;
};

// ---- life ---------------------------------------------------------------------------------------

static enum result read_certificate(const char *path, X509 **out, struct error *err) {
    FILE *file = fopen(path, "re");
    if (!file)
        return fail(err, RESULT_MISSING, "%s: %s", path, strerror(errno));
    *out = PEM_read_X509(file, NULL, NULL, NULL);
    fclose(file);
    return *out ? RESULT_OK : fail(err, RESULT_FORMAT, "%s: no certificate in PEM", path);
}

enum result host_check_create(const char *certificate_path, const char *const *names,
                              struct host_check **out_check, struct error *err) {
    X509 *certificate;
    *out_check = NULL;
    if (!certificate_path) {
        *out_check = alloc(1, sizeof **out_check);
        return RESULT_OK;
    }
    enum result result = read_certificate(certificate_path, &certificate, err);
    if (result != RESULT_OK)
        return result;
    struct host_check *hosts = alloc(1, sizeof *hosts);
    hosts->path = alloc_text(certificate_path);
    hosts->certificate = certificate;
    for (; names[hosts->name_count]; hosts->name_count++) {
        CHECK(hosts->name_count < NAMES_MAX);
        hosts->names[hosts->name_count] = alloc_text(names[hosts->name_count]);
    }
    *out_check = hosts;
    return RESULT_OK;
}

void host_check_renew(struct host_check *hosts) {
    X509 *certificate;
    if (read_certificate(hosts->path, &certificate, NULL) != RESULT_OK)
        return;
    X509_free(hosts->certificate);
    hosts->certificate = certificate;
}

void host_check_destroy(struct host_check **hosts) {
    if (!*hosts)
        return;
    free((*hosts)->path);
    X509_free((*hosts)->certificate);
    for (int i = 0; i < (*hosts)->name_count; i++)
        free((*hosts)->names[i]);
    free(*hosts);
    *hosts = NULL;
}

// ---- hosts --------------------------------------------------------------------------------------

// The name in "name", "name:port" or "[address]:port". False if the text is something else.
static bool name_of_host(const char *host, char out[NAME_MAX_LENGTH]) {
    bool bracketed = host[0] == '[';
    size_t length = bracketed ? strcspn(++host, "]") : strcspn(host, ":");
    const char *port = host + length;
    if (bracketed && *port++ != ']')
        return false;
    if (*port && (*port != ':' || strspn(port + 1, "0123456789") != strlen(port + 1)))
        return false;
    if (length == 0 || length >= NAME_MAX_LENGTH)
        return false;
    memcpy(out, host, length);
    out[length] = '\0';
    return true;
}

// Nobody but its owner has an address: only names can be made to point here.
static bool is_address(const char *name) {
    struct in6_addr address;
    return inet_pton(AF_INET, name, &address) == 1 || inet_pton(AF_INET6, name, &address) == 1;
}

static bool is_loopback(const char *name) {
    struct in_addr address;
    return !strcasecmp(name, "localhost") || !strcmp(name, "::1") ||
           (inet_pton(AF_INET, name, &address) == 1 && ntohl(address.s_addr) >> 24 == 127);
}

bool host_check_is_own(const struct host_check *hosts, const char *host) {
    char name[NAME_MAX_LENGTH];
    if (!name_of_host(host, name))
        return false;
    if (!hosts->certificate)
        return is_loopback(name);
    for (int i = 0; i < hosts->name_count; i++)
        if (!strcasecmp(name, hosts->names[i]))
            return true;
    return is_address(name) || !strcasecmp(name, "localhost") ||
           X509_check_host(hosts->certificate, name, 0, 0, NULL) == 1;
}

// The certificate's first name. False if it has only addresses, or the name is too long.
static bool first_name(const X509 *certificate, char *out_name, size_t size) {
    GENERAL_NAMES *names = X509_get_ext_d2i(certificate, NID_subject_alt_name, NULL, NULL);
    int length = -1;
    for (int i = 0; length < 0 && i < sk_GENERAL_NAME_num(names); i++) {
        const GENERAL_NAME *name = sk_GENERAL_NAME_value(names, i);
        if (name->type == GEN_DNS)
            length = snprintf(out_name, size, "%.*s", ASN1_STRING_length(name->d.dNSName),
                              (const char *)ASN1_STRING_get0_data(name->d.dNSName));
    }
    GENERAL_NAMES_free(names);
    return length > 0 && (size_t)length < size;
}

void host_check_public_name(const struct host_check *hosts, const char *name, char *out_name,
                            size_t size) {
    if (host_check_is_own(hosts, name))
        snprintf(out_name, size, "%s", name);
    else if (!first_name(hosts->certificate, out_name, size))
        snprintf(out_name, size, "localhost");
}

bool host_check_is_origin(const struct host_check *hosts, const char *origin, const char *host) {
    const char *scheme = hosts->certificate ? "https://" : "http://";
    size_t length = strlen(scheme);
    return !strncmp(origin, scheme, length) && !strcasecmp(origin + length, host);
}
