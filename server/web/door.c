#include "web/door.h"

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

struct door {
    char *path;
    X509 *certificate;
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

enum result door_create(const char *certificate_path, const char *const *names,
                        struct door **out_door, struct error *err) {
    X509 *certificate;
    *out_door = NULL;
    enum result result = read_certificate(certificate_path, &certificate, err);
    if (result != RESULT_OK)
        return result;
    struct door *door = alloc(1, sizeof *door);
    door->path = alloc_text(certificate_path);
    door->certificate = certificate;
    for (; names[door->name_count]; door->name_count++) {
        CHECK(door->name_count < NAMES_MAX);
        door->names[door->name_count] = alloc_text(names[door->name_count]);
    }
    *out_door = door;
    return RESULT_OK;
}

void door_renew(struct door *door) {
    X509 *certificate;
    if (read_certificate(door->path, &certificate, NULL) != RESULT_OK)
        return;
    X509_free(door->certificate);
    door->certificate = certificate;
}

void door_destroy(struct door **door) {
    if (!*door)
        return;
    free((*door)->path);
    X509_free((*door)->certificate);
    for (int i = 0; i < (*door)->name_count; i++)
        free((*door)->names[i]);
    free(*door);
    *door = NULL;
}

// ---- hosts --------------------------------------------------------------------------------------

// Splits "name", "name:port", "[address]:port" and leaves the name; false where it is none of them.
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

bool door_is_own_host(const struct door *door, const char *host) {
    char name[NAME_MAX_LENGTH];
    if (!name_of_host(host, name))
        return false;
    for (int i = 0; i < door->name_count; i++)
        if (!strcasecmp(name, door->names[i]))
            return true;
    return is_address(name) || !strcasecmp(name, "localhost") ||
           X509_check_host(door->certificate, name, 0, 0, NULL) == 1;
}

// The certificate's first name; false where it has none but addresses, or it is too long.
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

void door_reached_as(const struct door *door, const char *name, char *out_name, size_t size) {
    if (door_is_own_host(door, name))
        snprintf(out_name, size, "%s", name);
    else if (!first_name(door->certificate, out_name, size))
        snprintf(out_name, size, "localhost");
}

bool door_is_origin_of(const char *origin, const char *host) {
    static const char scheme[] = "https://";
    return !strncmp(origin, scheme, sizeof scheme - 1) &&
           !strcasecmp(origin + sizeof scheme - 1, host);
}

// ---- tokens -------------------------------------------------------------------------------------

// RFC 6750, 2.1
static bool take_token(const char *text, size_t length, char out_token[DOOR_TOKEN_MAX]) {
    if (length == 0 || length >= DOOR_TOKEN_MAX)
        return false;
    for (size_t i = 0; i < length; i++)
        if (!isalnum((unsigned char)text[i]) && !strchr("-._~+/=", text[i]))
            return false;
    memcpy(out_token, text, length);
    out_token[length] = '\0';
    return true;
}

bool door_token_of_cookies(const char *cookies, char out_token[DOOR_TOKEN_MAX]) {
    static const char name[] = "arthron=";
    for (const char *at = cookies; *at;) {
        at += strspn(at, "; ");
        size_t length = strcspn(at, "; ");
        if (!strncmp(at, name, sizeof name - 1))
            return take_token(at + sizeof name - 1, length - (sizeof name - 1), out_token);
        at += length;
    }
    return false;
}

bool door_token_of_authorization(const char *authorization, char out_token[DOOR_TOKEN_MAX]) {
    static const char scheme[] = "Bearer ";
    if (strncasecmp(authorization, scheme, sizeof scheme - 1))
        return false;
    const char *token = authorization + sizeof scheme - 1;
    return take_token(token, strlen(token), out_token);
}
