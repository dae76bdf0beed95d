#include "xapi/words.h"

#include <ctype.h>
#include <openssl/evp.h>
#include <stdbool.h>
#include <string.h>
#include <unistd.h>

enum result xapi_check_site(const char *site, struct error *err) {
    bool has_scheme = !strncmp(site, "https://", 8) || !strncmp(site, "http://", 7);
    size_t length = strlen(site);
    bool plain = true;
    for (size_t i = 0; i < length; i++)
        plain = plain && site[i] > 0x20 && site[i] < 0x7f && !strchr("\"<>\\^`{|}", site[i]);
    if (!has_scheme || !plain || length >= XAPI_SITE_MAX || site[length - 1] == '/')
        return fail(err, RESULT_INVALID,
                    "%.80s: not an address like https://training.example.org/arthron", site);
    return RESULT_OK;
}

void xapi_usual_site(char out[XAPI_SITE_MAX]) {
    char host[65] = "localhost";
    gethostname(host, sizeof host - 1);
    snprintf(out, XAPI_SITE_MAX, "https://%s/arthron", host);
}

// ---- ids ----------------------------------------------------------------------------------------

// Sets version and variant of a UUID of 32 digits (RFC 4122).
static void write_uuid(const char *digits, char version, char out[37]) {
    static const char variants[] = "89ab";
    char variant = digits[16];
    snprintf(out, 37, "%.8s-%.4s-%c%.3s-%c%.3s-%.12s", digits, digits + 8, version, digits + 13,
             variants[(variant <= '9' ? variant - '0' : variant - 'a' + 10) & 3], digits + 17,
             digits + 20);
}

void xapi_session_uuid(const char *id, char out[37]) {
    write_uuid(id, '4', out);
}

static int digit_of(char c) {
    return c <= '9' ? c - '0' : c - 'a' + 10;
}

void xapi_attempt_uuid(const char *session, int number, char out[37]) {
    char digits[37], *at = digits;
    unsigned char bytes[64], hash[EVP_MAX_MD_SIZE];
    xapi_session_uuid(session, digits);
    for (int i = 0; i < 16; i++, at += 2) {
        at += *at == '-';
        bytes[i] = (unsigned char)(digit_of(at[0]) << 4 | digit_of(at[1]));
    }
    int length = snprintf((char *)bytes + 16, sizeof bytes - 16, "attempt %d", number);
    EVP_Digest(bytes, 16 + (size_t)length, hash, NULL, EVP_sha1(), NULL);
    for (int i = 0; i < 16; i++)
        snprintf(digits + 2 * i, 3, "%02x", hash[i]);
    write_uuid(digits, '5', out);
}

void xapi_iri(const char *site, const char *kind, const char *name, char out[XAPI_IRI_MAX]) {
    size_t used = (size_t)snprintf(out, XAPI_IRI_MAX, "%s/%s/", site, kind);
    for (; *name && used + 4 < XAPI_IRI_MAX; name++) {
        unsigned char c = (unsigned char)*name;
        bool plain = c < 0x80 && (isalnum(c) || strchr("-._~", c));
        used += (size_t)snprintf(out + used, XAPI_IRI_MAX - used, plain ? "%c" : "%%%02X", c);
    }
}

// ---- parts --------------------------------------------------------------------------------------

json_t *xapi_extension(const char *site, const char *name, json_t *value) {
    char iri[XAPI_IRI_MAX];
    json_t *extensions = json_object();
    xapi_iri(site, "xapi", name, iri);
    json_object_set_new(extensions, iri, value);
    return extensions;
}

json_t *xapi_actor(const char *site, const char *account) {
    return json_pack("{s:s, s:{s:s, s:s}}", "objectType", "Agent", "account", "homePage", site,
                     "name", account);
}

json_t *xapi_verb(const char *name) {
    char iri[64];
    snprintf(iri, sizeof iri, XAPI_VERB "%s", name);
    return json_pack("{s:s, s:{s:s}}", "id", iri, "display", "en", name);
}

void xapi_duration(double seconds, char out[32]) {
    snprintf(out, 32, "PT%.2fS", seconds > 0 ? seconds : 0);
}
