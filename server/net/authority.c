#include "net/authority.h"

#include "base/check.h"
#include "base/clock.h"
#include "net/authority_files.h"
#include "net/certificate.h"
#include "wire/code.h"

#include <arpa/inet.h>
#include <errno.h>
#include <openssl/crypto.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#define DAY_S INT64_C(86400)
#define HOSTS_MAX 16
#define HOST_NAME_MAX_LENGTH 253
#define STATION_NAME_MAX_LENGTH 63

_Static_assert(CODE_TEXT_MAX <= AUTHORITY_CODE_MAX, "a code's text fits");

static int64_t now_s(void) {
    return clock_utc_ns() / NS_PER_S;
}

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

static enum result check_name(const char *station, struct error *err) {
    if (authority_name_is_valid(station))
        return RESULT_OK;
    return fail(err, RESULT_INVALID,
                "station name: letters, digits, '-', '_' and '.', from 1 to %d of them",
                STATION_NAME_MAX_LENGTH);
}

// ---- keys and certificates on disk --------------------------------------------------------------

static enum result write_memory(const char *dir, const char *name, BIO *memory, struct error *err) {
    char *data;
    long size = BIO_get_mem_data(memory, &data);
    enum result result = authority_write(dir, name, data, (size_t)size, err);
    OPENSSL_cleanse(data, (size_t)size);
    BIO_free(memory);
    return result;
}

static enum result write_key(const char *dir, const char *name, EVP_PKEY *key, struct error *err) {
    BIO *memory = BIO_new(BIO_s_secmem());
    CHECK(memory);
    int written = PEM_write_bio_PrivateKey(memory, key, NULL, NULL, 0, NULL, NULL);
    CHECK(written == 1);
    return write_memory(dir, name, memory, err);
}

static enum result write_certificate(const char *dir, const char *name, X509 *certificate,
                                     struct error *err) {
    BIO *memory = BIO_new(BIO_s_mem());
    CHECK(memory);
    int written = PEM_write_bio_X509(memory, certificate);
    CHECK(written == 1);
    return write_memory(dir, name, memory, err);
}

static FILE *open_in(const char *dir, const char *name) {
    char path[4096];
    int used = snprintf(path, sizeof path, "%s/%s", dir, name);
    return used < (int)sizeof path ? fopen(path, "re") : NULL;
}

static X509 *read_certificate(const char *dir) {
    FILE *file = open_in(dir, "authority.pem");
    X509 *certificate = file ? PEM_read_X509(file, NULL, NULL, NULL) : NULL;
    if (file)
        fclose(file);
    return certificate;
}

static EVP_PKEY *read_key(const char *dir) {
    FILE *file = open_in(dir, "authority.key");
    EVP_PKEY *key = file ? PEM_read_PrivateKey(file, NULL, NULL, NULL) : NULL;
    if (file)
        fclose(file);
    return key;
}

static void issuer_release(struct issuer *issuer) {
    X509_free(issuer->certificate);
    EVP_PKEY_free(issuer->key);
}

static enum result issuer_read(const char *dir, struct issuer *out, struct error *err) {
    *out = (struct issuer){read_certificate(dir), read_key(dir)};
    if (!out->certificate || !out->key)
        return fail(err, RESULT_MISSING, "%s: no readable authority.pem and authority.key", dir);
    if (X509_check_private_key(out->certificate, out->key) != 1)
        return fail(err, RESULT_CORRUPT, "%s: authority.key is not the key of authority.pem", dir);
    return RESULT_OK;
}

static enum result write_der(X509 *certificate, uint8_t *out_der, size_t *in_out_size,
                             struct error *err) {
    int size = i2d_X509(certificate, NULL);
    CHECK(size > 0);
    if ((size_t)size > *in_out_size)
        return fail(err, RESULT_LIMIT, "the certificate takes %d bytes, %zu are there", size,
                    *in_out_size);
    *in_out_size = (size_t)i2d_X509(certificate, &out_der);
    return RESULT_OK;
}

static void fingerprint_of(X509 *certificate, uint8_t out[CODE_FINGERPRINT_SIZE]) {
    unsigned char *der = NULL;
    int size = i2d_X509(certificate, &der);
    CHECK(size > 0);
    code_fingerprint(der, (size_t)size, out);
    OPENSSL_free(der);
}

// ---- init ---------------------------------------------------------------------------------------

static bool is_address(const char *host) {
    uint8_t bytes[sizeof(struct in6_addr)];
    return inet_pton(AF_INET, host, bytes) == 1 || inet_pton(AF_INET6, host, bytes) == 1;
}

static enum result alternative_names(const char *const *hosts, int count, char *out, size_t size,
                                     struct error *err) {
    if (count < 1 || count > HOSTS_MAX)
        return fail(err, RESULT_INVALID, "from 1 to %d host names, not %d", HOSTS_MAX, count);
    size_t used = 0;
    for (int i = 0; i < count; i++) {
        bool address = is_address(hosts[i]);
        if (!address && !consists_of(hosts[i], "-_.", HOST_NAME_MAX_LENGTH))
            return fail(err, RESULT_INVALID, "host %d is no name and no address", i + 1);
        used += (size_t)snprintf(out + used, size - used, "%s%s:%s", i ? "," : "",
                                 address ? "IP" : "DNS", hosts[i]);
        CHECK(used < size);
    }
    return RESULT_OK;
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
    X509 *server = certificate_make(CERTIFICATE_SERVER, "Arthron server", names, key, &authority);
    enum result result = write_key(dir, "server.key", key, err);
    if (result == RESULT_OK)
        result = write_certificate(dir, "server.pem", server, err);
    if (result == RESULT_OK)
        result = write_key(dir, "authority.key", authority.key, err);
    if (result == RESULT_OK)
        result = write_certificate(dir, "authority.pem", authority.certificate, err);
    X509_free(server);
    EVP_PKEY_free(key);
    issuer_release(&authority);
    return result;
}

enum result authority_init(const char *dir, const char *const *hosts, int host_count,
                           struct error *err) {
    char names[HOSTS_MAX * (HOST_NAME_MAX_LENGTH + 8)];
    enum result result = alternative_names(hosts, host_count, names, sizeof names, err);
    int lock;
    if (result == RESULT_OK)
        result = make_folder(dir, err);
    if (result == RESULT_OK)
        result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    FILE *there = open_in(dir, "authority.pem");
    if (there) {
        fclose(there);
        result = fail(err, RESULT_REFUSED, "%s: there is an authority already", dir);
    } else {
        result = make_all(dir, names, err);
    }
    close(lock);
    return result;
}

// ---- codes --------------------------------------------------------------------------------------

static void hash_secret(const struct code *code, char out_hex[RECORD_KEY_MAX]) {
    uint8_t hash[32];
    int done = EVP_Digest(code->secret, sizeof code->secret, hash, NULL, EVP_sha256(), NULL);
    CHECK(done == 1);
    for (int i = 0; i < 32; i++)
        snprintf(out_hex + 2 * i, 3, "%02x", hash[i]);
}

static void remove_ended(struct records *codes, int64_t time_s) {
    for (int i = codes->count - 1; i >= 0; i--)
        if (codes->items[i].utc_s <= time_s)
            records_remove(codes, i);
}

static void remove_station(struct records *codes, const char *station) {
    for (int i = codes->count - 1; i >= 0; i--)
        if (!strcmp(codes->items[i].station, station))
            records_remove(codes, i);
}

static enum result store_code(const char *dir, const struct code *code, const char *station,
                              struct error *err) {
    struct records codes;
    enum result result = records_read(dir, "codes", &codes, err);
    if (result == RESULT_OK) {
        char key[RECORD_KEY_MAX];
        hash_secret(code, key);
        remove_ended(&codes, now_s());
        remove_station(&codes, station);
        records_add(&codes, key, now_s() + AUTHORITY_CODE_S, station);
        result = records_write(dir, "codes", &codes, err);
    }
    records_release(&codes);
    return result;
}

enum result authority_issue_code(const char *dir, const char *station,
                                 char out_code[AUTHORITY_CODE_MAX], struct error *err) {
    enum result result = check_name(station, err);
    if (result != RESULT_OK)
        return result;
    X509 *certificate = read_certificate(dir);
    if (!certificate)
        return fail(err, RESULT_MISSING, "%s: no readable authority.pem", dir);
    struct code code;
    int made = RAND_bytes(code.secret, sizeof code.secret);
    CHECK(made == 1);
    fingerprint_of(certificate, code.fingerprint);
    X509_free(certificate);
    int lock;
    result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    result = store_code(dir, &code, station, err);
    close(lock);
    if (result == RESULT_OK)
        code_write(&code, out_code);
    OPENSSL_cleanse(&code, sizeof code);
    return result;
}

// ---- enrolment ----------------------------------------------------------------------------------

// All records are compared in full, so that the time tells nothing about them.
static int find_code(const struct records *codes, const struct code *code) {
    char key[RECORD_KEY_MAX];
    hash_secret(code, key);
    int found = -1;
    for (int i = 0; i < codes->count; i++)
        if (!CRYPTO_memcmp(codes->items[i].key, key, RECORD_KEY_MAX))
            found = i;
    return found;
}

static enum result note_issued(const char *dir, const X509 *certificate, const char *station,
                               struct error *err) {
    struct records issued;
    enum result result = records_read(dir, "issued", &issued, err);
    if (result == RESULT_OK) {
        char serial[CERTIFICATE_SERIAL_SIZE];
        certificate_serial(certificate, serial);
        records_add(&issued, serial, now_s(), station);
        result = records_write(dir, "issued", &issued, err);
    }
    records_release(&issued);
    return result;
}

struct enrolment {
    const char *dir;
    struct code code;
    EVP_PKEY *key;                    // the station's
    char name[CERTIFICATE_NAME_SIZE]; // as the station asks for
    struct issuer authority;
    struct records codes;
    X509 *certificate;
};

// Under the lock. The certificate is on record before the code is used up, and the code is used up
// before anyone sees the certificate.
static enum result use_code(struct enrolment *e, struct error *err) {
    enum result result = records_read(e->dir, "codes", &e->codes, err);
    if (result != RESULT_OK)
        return result;
    remove_ended(&e->codes, now_s());
    int index = find_code(&e->codes, &e->code);
    if (index < 0)
        return fail(err, RESULT_REFUSED, "the code is not known here, used already or too old");
    const char *station = e->codes.items[index].station;
    if (strcmp(e->name, station))
        return fail(err, RESULT_REFUSED, "the code was made for another station than %s", e->name);
    e->certificate = certificate_make(CERTIFICATE_STATION, station, NULL, e->key, &e->authority);
    result = note_issued(e->dir, e->certificate, station, err);
    records_remove(&e->codes, index);
    if (result == RESULT_OK)
        result = records_write(e->dir, "codes", &e->codes, err);
    return result;
}

static enum result use_code_locked(struct enrolment *e, struct error *err) {
    int lock;
    enum result result = issuer_read(e->dir, &e->authority, err);
    if (result == RESULT_OK)
        result = authority_lock(e->dir, false, &lock, err);
    if (result != RESULT_OK)
        return result;
    result = use_code(e, err);
    close(lock);
    return result;
}

enum result authority_enrol(const char *dir, const char *code, const uint8_t *request_der,
                            size_t request_size, uint8_t *out_certificate_der,
                            size_t *in_out_certificate_size, uint8_t *out_authority_der,
                            size_t *in_out_authority_size, struct error *err) {
    struct enrolment e = {.dir = dir};
    enum result result = code_read(code, &e.code, err);
    if (result != RESULT_OK)
        return result;
    e.key = certificate_request_key(request_der, request_size, e.name);
    if (!e.key)
        return fail(err, RESULT_FORMAT,
                    "the request is not PKCS #10, signed, with an EC key on P-256");
    result = use_code_locked(&e, err);
    if (result == RESULT_OK)
        result = write_der(e.certificate, out_certificate_der, in_out_certificate_size, err);
    if (result == RESULT_OK)
        result = write_der(e.authority.certificate, out_authority_der, in_out_authority_size, err);
    X509_free(e.certificate);
    EVP_PKEY_free(e.key);
    records_release(&e.codes);
    issuer_release(&e.authority);
    OPENSSL_cleanse(&e.code, sizeof e.code);
    return result;
}

// ---- revocation ---------------------------------------------------------------------------------

static bool contains(const struct records *records, const char *serial) {
    for (int i = 0; i < records->count; i++)
        if (!strcasecmp(records->items[i].key, serial))
            return true;
    return false;
}

static enum result revoke_issued(const char *dir, const char *station, const struct records *issued,
                                 struct records *revoked, struct error *err) {
    bool any = false;
    for (int i = 0; i < issued->count; i++)
        if (!strcmp(issued->items[i].station, station)) {
            any = true;
            if (!contains(revoked, issued->items[i].key))
                records_add(revoked, issued->items[i].key, now_s(), station);
        }
    if (!any)
        return fail(err, RESULT_MISSING, "%s: no certificate was ever issued to station %s", dir,
                    station);
    return records_write(dir, "revoked", revoked, err);
}

static enum result void_codes(const char *dir, const char *station, struct error *err) {
    struct records codes;
    enum result result = records_read(dir, "codes", &codes, err);
    if (result == RESULT_OK) {
        remove_station(&codes, station);
        result = records_write(dir, "codes", &codes, err);
    }
    records_release(&codes);
    return result;
}

enum result authority_revoke(const char *dir, const char *station, struct error *err) {
    int lock;
    enum result result = check_name(station, err);
    if (result == RESULT_OK)
        result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    struct records issued = {0}, revoked = {0};
    result = records_read(dir, "issued", &issued, err);
    if (result == RESULT_OK)
        result = records_read(dir, "revoked", &revoked, err);
    if (result == RESULT_OK)
        result = void_codes(dir, station, err);
    if (result == RESULT_OK)
        result = revoke_issued(dir, station, &issued, &revoked, err);
    records_release(&issued);
    records_release(&revoked);
    close(lock);
    return result;
}

// ---- state --------------------------------------------------------------------------------------

enum result authority_station_until(const char *dir, const char *station, int64_t *out_utc_s,
                                    struct error *err) {
    struct records issued = {0}, revoked = {0};
    *out_utc_s = 0;
    enum result result = records_read(dir, "issued", &issued, err);
    if (result == RESULT_OK)
        result = records_read(dir, "revoked", &revoked, err);
    for (int i = 0; result == RESULT_OK && i < issued.count; i++) {
        const struct record *record = &issued.items[i];
        int64_t until_s = record->utc_s + CERTIFICATE_DAYS * DAY_S;
        if (!strcmp(record->station, station) && until_s > now_s() && until_s > *out_utc_s &&
            !contains(&revoked, record->key))
            *out_utc_s = until_s;
    }
    records_release(&issued);
    records_release(&revoked);
    return result;
}
