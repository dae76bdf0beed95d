// Stations: codes, and the certificates that come of them.
#include "base/check.h"
#include "base/clock.h"
#include "net/authority.h"
#include "net/authority_files.h"
#include "net/authority_keys.h"
#include "wire/code.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#define DAY_S INT64_C(86400)
#define NAME_MAX_LENGTH 63
#define CERTIFICATES_MAX 16 // of one station, good at the same time

_Static_assert(CODE_TEXT_MAX <= AUTHORITY_CODE_MAX, "a code's text fits");

static int64_t now_s(void) {
    return clock_utc_ns() / NS_PER_S;
}

static enum result check_name(const char *station, struct error *err) {
    if (authority_name_is_valid(station))
        return RESULT_OK;
    return fail(err, RESULT_INVALID,
                "station name: letters, digits, '-', '_' and '.', from 1 to %d of them",
                NAME_MAX_LENGTH);
}

static enum result write_der(X509 *certificate, uint8_t *out_der, size_t *in_out_size,
                             struct error *err) {
    int size = i2d_X509(certificate, NULL);
    NEED(size > 0, "memory");
    if ((size_t)size > *in_out_size)
        return fail(err, RESULT_LIMIT, "the certificate takes %d bytes, more than %zu", size,
                    *in_out_size);
    *in_out_size = (size_t)i2d_X509(certificate, &out_der);
    return RESULT_OK;
}

static void fingerprint_of(X509 *certificate, uint8_t out[CODE_FINGERPRINT_SIZE]) {
    unsigned char *der = NULL;
    int size = i2d_X509(certificate, &der);
    NEED(size > 0, "memory");
    code_fingerprint(der, (size_t)size, out);
    OPENSSL_free(der);
}

// ---- codes --------------------------------------------------------------------------------------

static void hash_secret(const struct code *code, char out_hex[RECORD_KEY_MAX]) {
    uint8_t hash[32];
    int done = EVP_Digest(code->secret, sizeof code->secret, hash, NULL, EVP_sha256(), NULL);
    NEED(done == 1, "memory");
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
    X509 *certificate = authority_read_certificate(dir, "authority.pem");
    if (!certificate)
        return fail(err, RESULT_MISSING, "%s: authority.pem is missing or unreadable", dir);
    struct code code;
    int made = RAND_bytes(code.secret, sizeof code.secret);
    NEED(made == 1, "memory");
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

static enum result note(const char *dir, const char *file, const X509 *certificate,
                        const char *station, bool alone, struct error *err) {
    struct records records;
    enum result result = records_read(dir, file, &records, err);
    if (result == RESULT_OK) {
        char serial[CERTIFICATE_SERIAL_SIZE];
        certificate_serial(certificate, serial);
        if (alone)
            remove_station(&records, station);
        records_add(&records, serial, now_s(), station);
        result = records_write(dir, file, &records, err);
    }
    records_release(&records);
    return result;
}

struct station_enrolment {
    const char *dir;
    EVP_PKEY *key;                     // the station's
    char asked[CERTIFICATE_NAME_SIZE]; // the name in the request, empty: none
    struct issuer authority;
    X509 *certificate;
};

// Under the lock.
static enum result issue(struct station_enrolment *e, const char *station, struct error *err) {
    if (e->asked[0] && strcmp(e->asked, station) != 0)
        return fail(err, RESULT_REFUSED, "the certificate would be for station %s, not %s", station,
                    e->asked);
    e->certificate = certificate_make(CERTIFICATE_STATION, station, NULL, e->key, &e->authority);
    return note(e->dir, "issued", e->certificate, station, false, err);
}

static enum result refuse_code(struct error *err) {
    return fail(err, RESULT_REFUSED, "this code is unknown, used or expired");
}

// Under the lock. The certificate is on record before the code is used up, and the code is used up
// before anyone sees the certificate.
static enum result use_code(struct station_enrolment *e, const struct code *code,
                            struct error *err) {
    struct records codes;
    enum result result = records_read(e->dir, "codes", &codes, err);
    if (result == RESULT_OK) {
        remove_ended(&codes, now_s());
        int index = find_code(&codes, code);
        result = index < 0 ? refuse_code(err) : issue(e, codes.items[index].station, err);
        if (result == RESULT_OK)
            result =
                note(e->dir, "enrolled", e->certificate, codes.items[index].station, true, err);
        if (result == RESULT_OK) {
            records_remove(&codes, index);
            result = records_write(e->dir, "codes", &codes, err);
        }
    }
    records_release(&codes);
    return result;
}

// Whether it is worth the while to open the authority's key, which takes long where it is
// encrypted.
static enum result is_known(const char *dir, const struct code *code, struct error *err) {
    struct records codes;
    int lock;
    enum result result = authority_lock(dir, false, &lock, err);
    if (result != RESULT_OK)
        return result;
    result = records_read(dir, "codes", &codes, err);
    if (result == RESULT_OK) {
        remove_ended(&codes, now_s());
        if (find_code(&codes, code) < 0)
            result = refuse_code(err);
    }
    close(lock);
    records_release(&codes);
    return result;
}

static enum result begin(struct station_enrolment *e, const struct authority_request *request,
                         int *out_lock, struct error *err) {
    e->key = certificate_request_key(request->der, request->size, e->asked);
    if (!e->key)
        return fail(err, RESULT_FORMAT,
                    "the request is not PKCS #10, signed, with an EC key on P-256");
    enum result result = issuer_read(e->dir, &e->authority, err);
    return result == RESULT_OK ? authority_lock(e->dir, false, out_lock, err) : result;
}

static enum result answer_enrolment(const struct station_enrolment *e, struct authority_answer *out,
                                    struct error *err) {
    out->certificate_size = sizeof out->certificate_der;
    out->authority_size = sizeof out->authority_der;
    enum result result =
        write_der(e->certificate, out->certificate_der, &out->certificate_size, err);
    if (result == RESULT_OK)
        result = write_der(e->authority.certificate, out->authority_der, &out->authority_size, err);
    return result;
}

static void end(struct station_enrolment *e) {
    X509_free(e->certificate);
    EVP_PKEY_free(e->key);
    issuer_release(&e->authority);
}

enum result authority_enrol(const char *dir, const char *code_text,
                            const struct authority_request *request, struct authority_answer *out,
                            struct error *err) {
    struct station_enrolment e = {.dir = dir};
    struct code code;
    int lock;
    enum result result = code_read(code_text, &code, err);
    if (result == RESULT_OK)
        result = is_known(dir, &code, err);
    if (result != RESULT_OK)
        return result;
    result = begin(&e, request, &lock, err);
    if (result == RESULT_OK) {
        result = use_code(&e, &code, err);
        close(lock);
    }
    if (result == RESULT_OK)
        result = answer_enrolment(&e, out, err);
    end(&e);
    OPENSSL_cleanse(&code, sizeof code);
    return result;
}

// ---- renewal ------------------------------------------------------------------------------------

// All certificates of stations, in the order in which they were issued; and each one's last that
// came of a code. Keys of earlier programs have no record of these.
struct certificate_records {
    struct records issued, revoked, enrolled;
};

// Release with release_certificates, after an error too.
static enum result read_certificates(const char *dir, struct certificate_records *out,
                                     struct error *err) {
    *out = (struct certificate_records){0};
    enum result result = records_read(dir, "issued", &out->issued, err);
    if (result == RESULT_OK)
        result = records_read(dir, "revoked", &out->revoked, err);
    return result == RESULT_OK ? records_read(dir, "enrolled", &out->enrolled, err) : result;
}

static void release_certificates(struct certificate_records *records) {
    records_release(&records->issued);
    records_release(&records->revoked);
    records_release(&records->enrolled);
}

static bool contains(const struct records *records, const char *serial) {
    for (int i = 0; i < records->count; i++)
        if (!strcasecmp(records->items[i].key, serial))
            return true;
    return false;
}

static int count_good(const struct records *issued, const struct records *revoked,
                      const char *station) {
    int count = 0;
    for (int i = 0; i < issued->count; i++)
        count += !strcmp(issued->items[i].station, station) &&
                 issued->items[i].utc_s + CERTIFICATE_DAYS * DAY_S > now_s() &&
                 !contains(revoked, issued->items[i].key);
    return count;
}

static int find_serial(const struct records *issued, const char *serial) {
    int i = issued->count - 1;
    while (i >= 0 && strcasecmp(issued->items[i].key, serial) != 0)
        i--;
    return i;
}

// Whether somebody has enrolled the station again since this certificate was issued.
static bool is_replaced(const struct certificate_records *all, const char *station,
                        const char *serial) {
    for (int i = 0; i < all->enrolled.count; i++)
        if (!strcmp(all->enrolled.items[i].station, station))
            return find_serial(&all->issued, serial) <
                   find_serial(&all->issued, all->enrolled.items[i].key);
    return false;
}

// Under the lock. A renewal of each renewal would fill the folder.
static enum result may_renew(const char *dir, const char *station, const char *serial,
                             struct error *err) {
    struct certificate_records all;
    enum result result = read_certificates(dir, &all, err);
    if (result == RESULT_OK && contains(&all.revoked, serial))
        result = fail(err, RESULT_REFUSED, "this certificate is revoked");
    if (result == RESULT_OK && is_replaced(&all, station, serial))
        result = fail(err, RESULT_REFUSED, "station %s was enrolled again since", station);
    if (result == RESULT_OK && count_good(&all.issued, &all.revoked, station) >= CERTIFICATES_MAX)
        result = fail(err, RESULT_REFUSED,
                      "station %s has %d certificates: revoke them, and enrol it again", station,
                      CERTIFICATES_MAX);
    release_certificates(&all);
    return result;
}

enum result authority_renew(const char *dir, const char *station, const char *serial_hex,
                            const struct authority_request *request, struct authority_answer *out,
                            struct error *err) {
    struct station_enrolment e = {.dir = dir};
    int lock;
    enum result result = check_name(station, err);
    if (result == RESULT_OK)
        result = authority_lock(dir, false, &lock, err);
    if (result != RESULT_OK)
        return result;
    result = may_renew(dir, station, serial_hex, err); // before the key is opened, and again then
    close(lock);
    if (result != RESULT_OK)
        return result;
    result = begin(&e, request, &lock, err);
    if (result == RESULT_OK) {
        result = may_renew(dir, station, serial_hex, err);
        if (result == RESULT_OK)
            result = issue(&e, station, err);
        close(lock);
    }
    if (result == RESULT_OK)
        result = answer_enrolment(&e, out, err);
    end(&e);
    return result;
}

// ---- revocation ---------------------------------------------------------------------------------

static void add_revoked(struct records *revoked, const char *serial, const char *station) {
    if (!contains(revoked, serial))
        records_add(revoked, serial, now_s(), station);
}

// Serial numbers that other servers told. False: they are none.
static bool revoke_told(const char *serials, const char *station, struct records *revoked) {
    for (const char *at = serials; *at; at += strspn(at, " ")) {
        char serial[CERTIFICATE_SERIAL_SIZE];
        size_t length = strcspn(at, " ");
        if (!length || length >= sizeof serial || strspn(at, "0123456789ABCDEFabcdef") != length)
            return false;
        memcpy(serial, at, length);
        serial[length] = '\0';
        add_revoked(revoked, serial, station);
        at += length;
    }
    return true;
}

// Of those that have not ended, as far as there is room: the newest.
static void tell_revoked(const struct records *revoked, const char *station,
                         char out[AUTHORITY_SERIALS_SIZE]) {
    size_t used = 0;
    out[0] = '\0';
    for (int i = revoked->count - 1; i >= 0; i--) {
        const struct record *record = &revoked->items[i];
        if (strcmp(record->station, station) != 0 ||
            record->utc_s + CERTIFICATE_DAYS * DAY_S <= now_s() ||
            used + strlen(record->key) + 2 > AUTHORITY_SERIALS_SIZE)
            continue;
        used += (size_t)sprintf(out + used, "%s%s", used ? " " : "", record->key);
    }
}

static enum result revoke_issued(const char *dir, const char *station, const struct records *issued,
                                 struct records *revoked, struct error *err) {
    bool any = false;
    for (int i = 0; i < issued->count; i++)
        if (!strcmp(issued->items[i].station, station))
            add_revoked(revoked, issued->items[i].key, station);
    for (int i = 0; i < revoked->count; i++)
        any = any || !strcmp(revoked->items[i].station, station);
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

enum result authority_revoke_all(const char *dir, const char *station,
                                 char serials[AUTHORITY_SERIALS_SIZE], struct error *err) {
    int lock;
    enum result result = check_name(station, err);
    if (result == RESULT_OK)
        result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    struct certificate_records all;
    result = read_certificates(dir, &all, err);
    if (result == RESULT_OK)
        result = void_codes(dir, station, err);
    if (result == RESULT_OK && !revoke_told(serials, station, &all.revoked))
        result = fail(err, RESULT_FORMAT, "%s: these are no serial numbers", station);
    if (result == RESULT_OK)
        result = revoke_issued(dir, station, &all.issued, &all.revoked, err);
    if (result == RESULT_OK)
        tell_revoked(&all.revoked, station, serials);
    release_certificates(&all);
    close(lock);
    return result;
}

enum result authority_revoke(const char *dir, const char *station, struct error *err) {
    char serials[AUTHORITY_SERIALS_SIZE] = "";
    return authority_revoke_all(dir, station, serials, err);
}

// Those issued before the one of this serial number; how many were not revoked yet.
static int revoke_older(const struct records *issued, struct records *revoked, const char *station,
                        const char *serial) {
    int used = find_serial(issued, serial), count = 0;
    for (int i = 0; i < used; i++)
        if (!strcmp(issued->items[i].station, station) &&
            !contains(revoked, issued->items[i].key)) {
            records_add(revoked, issued->items[i].key, now_s(), station);
            count++;
        }
    return count;
}

enum result authority_used(const char *dir, const char *station, const char *serial_hex,
                           int *out_revoked, struct error *err) {
    int lock;
    *out_revoked = 0;
    enum result result = authority_lock(dir, false, &lock, err);
    if (result != RESULT_OK)
        return result;
    struct certificate_records all;
    result = read_certificates(dir, &all, err);
    if (result == RESULT_OK) {
        *out_revoked = revoke_older(&all.issued, &all.revoked, station, serial_hex);
        if (*out_revoked)
            result = records_write(dir, "revoked", &all.revoked, err);
    }
    release_certificates(&all);
    close(lock);
    return result;
}

// ---- state --------------------------------------------------------------------------------------

enum result authority_station_until(const char *dir, const char *station, int64_t *out_utc_s,
                                    struct error *err) {
    struct certificate_records all;
    *out_utc_s = 0;
    enum result result = read_certificates(dir, &all, err);
    for (int i = 0; result == RESULT_OK && i < all.issued.count; i++) {
        const struct record *record = &all.issued.items[i];
        int64_t until_s = record->utc_s + CERTIFICATE_DAYS * DAY_S;
        if (!strcmp(record->station, station) && until_s > now_s() && until_s > *out_utc_s &&
            !contains(&all.revoked, record->key))
            *out_utc_s = until_s;
    }
    release_certificates(&all);
    return result;
}
