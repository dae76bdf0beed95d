// The authority: its files, its certificates as OpenSSL's own verification sees them, and codes
// that work once.
#include "net/authority.h"

#include "base/clock.h"
#include "folder.h"
#include "net/authority_files.h"
#include "net/authority_revocations.h"
#include "test.h"
#include "wire/code.h"

#include <dirent.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// ---- folders and files --------------------------------------------------------------------------

static char dir[FOLDER_MAX]; // a fresh authority for each test

static void path_in(const char *name, char out[128]) {
    snprintf(out, 128, "%s/%s", dir, name);
}

static int make_authority(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost", "127.0.0.1", "::1"};
    folder_make(dir);
    return authority_init(dir, hosts, 3, NULL) == RESULT_OK ? 0 : -1;
}

static int remove_authority(void **state) {
    (void)state;
    DIR *folder = opendir(dir);
    for (struct dirent *entry; (entry = readdir(folder));)
        if (entry->d_name[0] != '.')
            unlinkat(dirfd(folder), entry->d_name, 0);
    closedir(folder);
    return rmdir(dir);
}

static void read_file(const char *name, char *out, size_t size) {
    char path[128];
    path_in(name, path);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    out[fread(out, 1, size - 1, file)] = 0;
    fclose(file);
}

static void write_file(const char *name, const char *text) {
    char path[128];
    path_in(name, path);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static X509 *load_certificate(const char *name) {
    char path[128];
    path_in(name, path);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    X509 *certificate = PEM_read_X509(file, NULL, NULL, NULL);
    fclose(file);
    assert_non_null(certificate);
    return certificate;
}

// ---- enrolling ----------------------------------------------------------------------------------

struct request {
    EVP_PKEY *key;
    unsigned char *der;
    int size;
};

// name: NULL: an empty subject
static struct request make_request(EVP_PKEY *key, const char *name) {
    struct request request = {.key = key};
    X509_REQ *r = X509_REQ_new();
    if (name)
        X509_NAME_add_entry_by_txt(X509_REQ_get_subject_name(r), "CN", MBSTRING_UTF8,
                                   (const unsigned char *)name, -1, -1, 0);
    X509_REQ_set_pubkey(r, key);
    assert_true(X509_REQ_sign(r, key, EVP_sha256()) > 0);
    request.size = i2d_X509_REQ(r, &request.der);
    X509_REQ_free(r);
    return request;
}

static void release_request(struct request *request) {
    EVP_PKEY_free(request->key);
    OPENSSL_free(request->der);
}

struct answer {
    struct authority_answer a;
    struct error err;
};

static enum result enrol(const char *code, const struct request *request, struct answer *out) {
    struct authority_request r = {request->der, (size_t)request->size};
    strcpy(out->err.text, "nothing");
    return authority_enrol(dir, code, &r, &out->a, &out->err);
}

static enum result renew(const char *name, const char *serial, const struct request *request,
                         struct answer *out) {
    struct authority_request r = {request->der, (size_t)request->size};
    strcpy(out->err.text, "nothing");
    return authority_renew(dir, name, serial, &r, &out->a, &out->err);
}

static X509 *enrolled_certificate(const struct answer *answer) {
    const unsigned char *der = answer->a.certificate_der;
    X509 *certificate = d2i_X509(NULL, &der, (long)answer->a.certificate_size);
    assert_non_null(certificate);
    return certificate;
}

static void serial_of(X509 *certificate, char out[64]) {
    BIGNUM *number = ASN1_INTEGER_to_BN(X509_get0_serialNumber(certificate), NULL);
    char *text = BN_bn2hex(number);
    snprintf(out, 64, "%s", text);
    OPENSSL_free(text);
    BN_free(number);
}

static X509 *enrol_station(const char *name) {
    char code[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), name);
    assert_int_equal(authority_issue_code(dir, name, code, NULL), RESULT_OK);
    assert_int_equal(enrol(code, &request, &answer), RESULT_OK);
    release_request(&request);
    return enrolled_certificate(&answer);
}

// ---- certificates -------------------------------------------------------------------------------

// OpenSSL's verdict on a certificate for a purpose, with our authority as the only trusted one.
static int verdict(X509 *certificate, int purpose, const char *host, const char *address) {
    X509 *authority = load_certificate("authority.pem");
    X509_STORE *store = X509_STORE_new();
    X509_STORE_add_cert(store, authority);
    X509_STORE_CTX *context = X509_STORE_CTX_new();
    X509_STORE_CTX_init(context, store, certificate, NULL);
    X509_STORE_CTX_set_purpose(context, purpose);
    X509_VERIFY_PARAM *param = X509_STORE_CTX_get0_param(context);
    X509_VERIFY_PARAM_set_flags(param, X509_V_FLAG_X509_STRICT | X509_V_FLAG_CHECK_SS_SIGNATURE);
    if (host)
        X509_VERIFY_PARAM_set1_host(param, host, 0);
    if (address)
        X509_VERIFY_PARAM_set1_ip_asc(param, address);
    X509_verify_cert(context);
    int error = X509_STORE_CTX_get_error(context);
    X509_STORE_CTX_free(context);
    X509_STORE_free(store);
    X509_free(authority);
    return error;
}

static long days_good(X509 *certificate) {
    int days, seconds;
    ASN1_TIME_diff(&days, &seconds, NULL, X509_get0_notAfter(certificate));
    return days;
}

static void the_server_is_good_for_its_hosts_and_as_a_server_only(void **state) {
    (void)state;
    X509 *server = load_certificate("server.pem");
    assert_int_equal(verdict(server, X509_PURPOSE_SSL_SERVER, "localhost", NULL), X509_V_OK);
    assert_int_equal(verdict(server, X509_PURPOSE_SSL_SERVER, NULL, "127.0.0.1"), X509_V_OK);
    assert_int_equal(verdict(server, X509_PURPOSE_SSL_SERVER, NULL, "::1"), X509_V_OK);
    assert_int_equal(verdict(server, X509_PURPOSE_SSL_SERVER, "other", NULL),
                     X509_V_ERR_HOSTNAME_MISMATCH);
    assert_int_equal(verdict(server, X509_PURPOSE_SSL_CLIENT, NULL, NULL),
                     X509_V_ERR_INVALID_PURPOSE);
    assert_in_range(days_good(server), 728, 730);
    X509_free(server);
}

static void a_station_is_good_as_a_client_only(void **state) {
    (void)state;
    X509 *station = enrol_station("station-1");
    char name[64];
    X509_NAME_get_text_by_NID(X509_get_subject_name(station), NID_commonName, name, sizeof name);
    assert_string_equal(name, "station-1"); // the code's, whatever the request says
    assert_int_equal(verdict(station, X509_PURPOSE_SSL_CLIENT, NULL, NULL), X509_V_OK);
    assert_int_equal(verdict(station, X509_PURPOSE_SSL_SERVER, NULL, NULL),
                     X509_V_ERR_INVALID_PURPOSE);
    assert_true(X509_check_ca(station) == 0);
    assert_in_range(days_good(station), 728, 730);
    X509_free(station);
}

static void the_authority_may_sign_and_lives_ten_years(void **state) {
    (void)state;
    X509 *authority = load_certificate("authority.pem");
    assert_int_equal(X509_check_ca(authority), 1);
    assert_int_equal(X509_get_pathlen(authority), 0);
    assert_in_range(days_good(authority), 3648, 3650);
    assert_int_equal(X509_get_key_usage(authority), KU_KEY_CERT_SIGN | KU_CRL_SIGN);
    X509_free(authority);
}

static void serial_numbers_have_128_bits_and_differ(void **state) {
    (void)state;
    X509 *certificates[] = {load_certificate("authority.pem"), load_certificate("server.pem"),
                            enrol_station("a"), enrol_station("a")};
    char serials[4][64];
    for (int i = 0; i < 4; i++) {
        serial_of(certificates[i], serials[i]);
        assert_int_equal(strlen(serials[i]), 32);
        for (int k = 0; k < i; k++)
            assert_string_not_equal(serials[i], serials[k]);
        X509_free(certificates[i]);
    }
}

static void all_files_are_the_servers_own(void **state) {
    (void)state;
    struct stat owner;
    if (geteuid() == 0) // as root for a server that runs as someone else
        assert_int_equal(chown(dir, 4321, 4322), 0);
    assert_int_equal(stat(dir, &owner), 0);
    X509_free(enrol_station("station-1"));
    assert_int_equal(authority_revoke(dir, "station-1", NULL), RESULT_OK);
    struct stat status;
    assert_int_equal(stat(dir, &status), 0);
    assert_int_equal(status.st_mode & 0777, 0700);
    static const char *const names[] = {"authority.key", "authority.pem", "server.key",
                                        "server.pem",    "codes",         "issued",
                                        "revoked",       "lock"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char path[128];
        path_in(names[i], path);
        assert_int_equal(stat(path, &status), 0);
        assert_int_equal(status.st_mode & 0777, 0600);
        if (strstr("codes issued revoked lock", names[i])) // made or written again since
            assert_int_equal(status.st_uid, owner.st_uid);
    }
}

static void a_second_authority_in_one_folder_is_refused(void **state) {
    (void)state;
    static const char *const hosts[] = {"other"};
    char before[4096], after[4096];
    struct error err = {""};
    read_file("authority.key", before, sizeof before);
    assert_int_equal(authority_init(dir, hosts, 1, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, dir));
    read_file("authority.key", after, sizeof after);
    assert_string_equal(before, after);
}

static void hosts_that_are_none_are_refused(void **state) {
    (void)state;
    static const char *const bad[] = {
        "", "a b", "a,DNS:evil", "*.example.org", "a\n", "critical;CA:TRUE"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(authority_init("/tmp/arthron-never-made", &bad[i], 1, NULL),
                         RESULT_INVALID);
    assert_int_equal(authority_init("/tmp/arthron-never-made", NULL, 0, NULL), RESULT_INVALID);
    assert_int_equal(access("/tmp/arthron-never-made", F_OK), -1);
}

// ---- codes --------------------------------------------------------------------------------------

static void a_code_works_once(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
    assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
    assert_int_equal(enrol(code, &request, &answer), RESULT_OK);
    X509 *station = enrolled_certificate(&answer);
    assert_int_equal(EVP_PKEY_eq(X509_get0_pubkey(station), request.key), 1);
    X509_free(station);
    assert_int_equal(enrol(code, &request, &answer), RESULT_REFUSED);
    release_request(&request);
}

static void a_code_carries_the_fingerprint_of_its_authority(void **state) {
    (void)state;
    char text[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct code code;
    uint8_t fingerprint[CODE_FINGERPRINT_SIZE], whole[32];
    struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
    assert_int_equal(authority_issue_code(dir, "station-1", text, NULL), RESULT_OK);
    assert_int_equal(code_read(text, &code, NULL), RESULT_OK);
    assert_int_equal(enrol(text, &request, &answer), RESULT_OK);
    code_fingerprint(answer.a.authority_der, answer.a.authority_size, fingerprint);
    assert_memory_equal(fingerprint, code.fingerprint, sizeof fingerprint);
    X509 *authority = load_certificate("authority.pem");
    X509_digest(authority, EVP_sha256(), whole, NULL);
    assert_memory_equal(fingerprint, whole, sizeof fingerprint);
    X509_free(authority);
    release_request(&request);
}

static void the_secret_is_not_on_disk(void **state) {
    (void)state;
    char text[AUTHORITY_CODE_MAX], file[4096], hex[2 * CODE_SECRET_SIZE + 1];
    struct code code;
    assert_int_equal(authority_issue_code(dir, "station-1", text, NULL), RESULT_OK);
    assert_int_equal(code_read(text, &code, NULL), RESULT_OK);
    for (int i = 0; i < CODE_SECRET_SIZE; i++)
        snprintf(hex + 2 * i, 3, "%02x", code.secret[i]);
    read_file("codes", file, sizeof file);
    assert_non_null(strstr(file, "station-1"));
    assert_null(strstr(file, hex));
    assert_null(strstr(file, text));
}

static void a_code_lives_fifteen_minutes(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX], file[4096], key[80], text[4096];
    long long ends;
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
    assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
    read_file("codes", file, sizeof file);
    assert_int_equal(sscanf(file, "%79s %lld", key, &ends), 2);
    long long now = clock_utc_ns() / NS_PER_S;
    assert_in_range(ends, now + 895, now + 900);
    snprintf(text, sizeof text, "%s %lld station-1\n", key, now - 1);
    write_file("codes", text);
    assert_int_equal(enrol(code, &request, &answer), RESULT_REFUSED);
    snprintf(text, sizeof text, "%s %lld station-1\n", key, now + 60);
    write_file("codes", text);
    assert_int_equal(enrol(code, &request, &answer), RESULT_OK);
    release_request(&request);
}

static void a_new_code_voids_the_one_before_but_not_another_stations(void **state) {
    (void)state;
    char first[AUTHORITY_CODE_MAX], second[AUTHORITY_CODE_MAX], other[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
    struct request neighbour = make_request(EVP_EC_gen("P-256"), "station-2");
    assert_int_equal(authority_issue_code(dir, "station-1", first, NULL), RESULT_OK);
    assert_int_equal(authority_issue_code(dir, "station-2", other, NULL), RESULT_OK);
    assert_int_equal(authority_issue_code(dir, "station-1", second, NULL), RESULT_OK);
    assert_int_equal(enrol(first, &request, &answer), RESULT_REFUSED);
    assert_int_equal(enrol(other, &neighbour, &answer), RESULT_OK);
    assert_int_equal(enrol(second, &request, &answer), RESULT_OK);
    release_request(&neighbour);
    release_request(&request);
}

static void a_code_is_good_for_one_name_alone(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX];
    struct answer answer;
    static const char *const others[] = {"station-2", "station-", "station-11"};
    struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
    assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
    for (int i = 0; i < 3; i++) {
        struct request other = make_request(EVP_EC_gen("P-256"), others[i]);
        assert_int_equal(enrol(code, &other, &answer), RESULT_REFUSED);
        release_request(&other);
    }
    assert_int_equal(enrol(code, &request, &answer), RESULT_OK);
    release_request(&request);
}

static void a_request_may_leave_its_subject_empty(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX], name[64];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), NULL);
    assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
    assert_int_equal(enrol(code, &request, &answer), RESULT_OK);
    X509 *station = enrolled_certificate(&answer);
    X509_NAME_get_text_by_NID(X509_get_subject_name(station), NID_commonName, name, sizeof name);
    assert_string_equal(name, "station-1"); // the code's
    X509_free(station);
    release_request(&request);
}

struct rival {
    const char *code;
    const struct request *request;
    pthread_barrier_t *start;
    enum result result;
};

static void *come_at_once(void *argument) {
    struct rival *rival = argument;
    struct answer answer;
    pthread_barrier_wait(rival->start);
    do
        rival->result = enrol(rival->code, rival->request, &answer);
    while (rival->result == RESULT_TIMEOUT);
    return NULL;
}

static void of_many_who_come_at_once_one_gets_a_certificate(void **state) {
    (void)state;
    enum { RIVALS = 8 };
    for (int round = 0; round < 10; round++) {
        char code[AUTHORITY_CODE_MAX];
        struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
        pthread_t threads[RIVALS];
        struct rival rivals[RIVALS];
        pthread_barrier_t start;
        pthread_barrier_init(&start, NULL, RIVALS);
        assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
        int granted = 0;
        for (int i = 0; i < RIVALS; i++) {
            rivals[i] = (struct rival){code, &request, &start, RESULT_OK};
            pthread_create(&threads[i], NULL, come_at_once, &rivals[i]);
        }
        for (int i = 0; i < RIVALS; i++) {
            pthread_join(threads[i], NULL);
            granted += rivals[i].result == RESULT_OK;
            assert_true(rivals[i].result == RESULT_OK || rivals[i].result == RESULT_REFUSED);
        }
        assert_int_equal(granted, 1);
        pthread_barrier_destroy(&start);
        release_request(&request);
    }
}

static void while_another_is_at_work_nobody_enrols_and_no_code_is_used(void **state) {
    (void)state;
    int lock;
    char code[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "station-1");
    assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
    assert_int_equal(authority_lock(dir, true, &lock, NULL), RESULT_OK);
    assert_int_equal(enrol(code, &request, &answer), RESULT_TIMEOUT);
    close(lock);
    assert_int_equal(enrol(code, &request, &answer), RESULT_OK);
    release_request(&request);
}

static void a_bad_request_is_refused_and_leaves_the_code_good(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct request good = make_request(EVP_EC_gen("P-256"), "station-1");
    assert_int_equal(authority_issue_code(dir, "station-1", code, NULL), RESULT_OK);
    for (int size = 0; size < good.size; size++) {
        // A copy of just this size, so that reading past it is found out.
        unsigned char *der = malloc(size ? (size_t)size : 1);
        memcpy(der, good.der, (size_t)size);
        assert_int_equal(enrol(code, &(struct request){NULL, der, size}, &answer), RESULT_FORMAT);
        free(der);
    }
    for (int bit = 0; bit < 8 * good.size; bit += 7) {
        good.der[bit / 8] ^= (unsigned char)(1 << bit % 8);
        assert_int_equal(enrol(code, &good, &answer), RESULT_FORMAT);
        good.der[bit / 8] ^= (unsigned char)(1 << bit % 8);
    }
    unsigned char longer[1024] = {0};
    memcpy(longer, good.der, (size_t)good.size);
    assert_int_equal(enrol(code, &(struct request){NULL, longer, good.size + 1}, &answer),
                     RESULT_FORMAT);
    EVP_PKEY *others[] = {EVP_EC_gen("P-384"), EVP_RSA_gen(2048)};
    for (int i = 0; i < 2; i++) {
        struct request other = make_request(others[i], "station-1");
        assert_int_equal(enrol(code, &other, &answer), RESULT_FORMAT);
        release_request(&other);
    }
    assert_int_equal(enrol(code, &good, &answer), RESULT_OK);
    release_request(&good);
}

static void names_that_are_none_get_no_code(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX], longest[65];
    memset(longest, 'a', 64), longest[64] = 0;
    static const char *const bad[] = {"", "a b", "a/b", "a\n", "\xc3\xa4", "a:b"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(authority_issue_code(dir, bad[i], code, NULL), RESULT_INVALID);
    assert_int_equal(authority_issue_code(dir, longest, code, NULL), RESULT_INVALID);
    longest[63] = 0;
    assert_int_equal(authority_issue_code(dir, longest, code, NULL), RESULT_OK);
    assert_int_equal(authority_issue_code(dir, "A-z_0.9", code, NULL), RESULT_OK);
}

static void without_an_authority_there_are_no_codes(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX];
    struct error err = {""};
    assert_int_equal(authority_issue_code("/tmp/arthron-never-made", "a", code, &err),
                     RESULT_MISSING);
    assert_non_null(strstr(err.text, "/tmp/arthron-never-made"));
}

// ---- the text of a code -------------------------------------------------------------------------

static const struct code sample_code = {
    .secret = {0x00, 0x44, 0x32, 0x14, 0xc7, 0x42, 0x54, 0xb6, 0x35, 0xcf, 0x84, 0x65, 0x3a},
    .fingerprint = {0x56, 0xd7, 0xc6, 0x75, 0xbe, 0x77, 0xdf, 0xff, 0x00, 0x01, 0x02, 0x03, 0x04,
                    0x05, 0x06, 0x07},
};

static void assert_reads(const char *text) {
    struct code code;
    assert_int_equal(code_read(text, &code, NULL), RESULT_OK);
    assert_memory_equal(&code, &sample_code, sizeof code);
}

static void a_code_reads_as_a_person_may_type_it(void **state) {
    (void)state;
    char text[CODE_TEXT_MAX], typed[2 * CODE_TEXT_MAX];
    code_write(&sample_code, text);
    // Its first 20 bytes are the numbers 0 to 31, in five bits each.
    assert_memory_equal(text, "ABCDEF-GHIJKL-MNOPQR-STUVWX-YZ2345-67", 37);
    assert_int_equal(strlen(text), 55);
    assert_reads(text);
    int used = 0;
    for (const char *c = text; *c; c++)
        if (*c != '-')
            used += snprintf(typed + used, 3, "%c%s",
                             *c == 'O'   ? '0'
                             : *c == 'I' ? '1'
                             : *c == 'B' ? '8'
                                         : *c + ('a' - 'A') * (*c >= 'A'),
                             used % 7 ? "" : " ");
    assert_reads(typed);
}

static void a_mistyped_code_is_told_from_an_unknown_one(void **state) {
    (void)state;
    char text[CODE_TEXT_MAX], changed[CODE_TEXT_MAX + 2];
    struct code code;
    code_write(&sample_code, text);
    int wrong = 0, length = (int)strlen(text);
    for (int i = 0; i < length; i++) {
        strcpy(changed, text);
        changed[i] = text[i] == '-' ? '+' : text[i] == 'A' ? 'C' : 'A';
        wrong += code_read(changed, &code, NULL) == RESULT_FORMAT;
        snprintf(changed, sizeof changed, "%.*s%s", i, text, text + i + 1);
        if (text[i] != '-')
            assert_int_equal(code_read(changed, &code, NULL), RESULT_FORMAT);
    }
    assert_true(wrong >= length - 2); // a check of 8 bits misses one in 256
    static const char *const bad[] = {"", "-", "ABCDEF", "\xff", "9"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(code_read(bad[i], &code, NULL), RESULT_FORMAT);
    snprintf(changed, sizeof changed, "%sA", text);
    assert_int_equal(code_read(changed, &code, NULL), RESULT_FORMAT);
}

// ---- revocation ---------------------------------------------------------------------------------

static bool is_revoked(const char *serial) {
    struct revocations *revocations = revocations_read(dir, NULL);
    bool revoked = revocations_contain(revocations, serial);
    revocations_release(&revocations);
    return revoked;
}

static void revoking_a_station_ends_all_its_certificates_and_no_others(void **state) {
    (void)state;
    X509 *certificates[] = {enrol_station("a"), enrol_station("b"), enrol_station("a")};
    char serials[3][64];
    for (int i = 0; i < 3; i++) {
        serial_of(certificates[i], serials[i]);
        assert_false(is_revoked(serials[i]));
        X509_free(certificates[i]);
    }
    assert_int_equal(authority_revoke(dir, "a", NULL), RESULT_OK);
    assert_int_equal(authority_revoke(dir, "a", NULL), RESULT_OK);
    assert_true(is_revoked(serials[0]));
    assert_false(is_revoked(serials[1]));
    assert_true(is_revoked(serials[2]));
    X509 *again = enrol_station("a");
    serial_of(again, serials[0]);
    assert_false(is_revoked(serials[0]));
    X509_free(again);
}

static void a_certificate_that_is_used_revokes_those_before_it(void **state) {
    (void)state;
    X509 *certificates[] = {enrol_station("a"), enrol_station("b"), enrol_station("a"),
                            enrol_station("a")};
    static const bool gone[] = {true, false, false, false};
    char serials[4][64];
    int count = -1;
    for (int i = 0; i < 4; i++) {
        serial_of(certificates[i], serials[i]);
        X509_free(certificates[i]);
    }
    assert_int_equal(authority_used(dir, "a", serials[0], &count, NULL), RESULT_OK);
    assert_int_equal(count, 0);
    assert_int_equal(authority_used(dir, "a", "0123", &count, NULL), RESULT_OK); // of nobody
    assert_int_equal(count, 0);
    assert_int_equal(authority_used(dir, "a", serials[2], &count, NULL), RESULT_OK);
    assert_int_equal(count, 1);
    for (int i = 0; i < 4; i++)
        assert_int_equal(is_revoked(serials[i]), gone[i]);
    assert_int_equal(authority_used(dir, "a", serials[2], &count, NULL), RESULT_OK);
    assert_int_equal(count, 0);
}

// ---- renewal ------------------------------------------------------------------------------------

static void a_station_renews_by_the_certificate_that_it_has(void **state) {
    (void)state;
    char serial[64], name[64];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), NULL);
    struct request other = make_request(EVP_EC_gen("P-256"), "b");
    X509 *before = enrol_station("a");
    serial_of(before, serial);
    assert_int_equal(renew("a", serial, &other, &answer), RESULT_REFUSED);
    assert_int_equal(renew("a", serial, &request, &answer), RESULT_OK);
    X509 *after = enrolled_certificate(&answer);
    X509_NAME_get_text_by_NID(X509_get_subject_name(after), NID_commonName, name, sizeof name);
    assert_string_equal(name, "a");
    assert_int_equal(verdict(after, X509_PURPOSE_SSL_CLIENT, NULL, NULL), X509_V_OK);
    assert_int_equal(EVP_PKEY_eq(X509_get0_pubkey(after), request.key), 1);
    assert_false(is_revoked(serial)); // the new one may never arrive
    assert_int_equal(authority_revoke(dir, "a", NULL), RESULT_OK);
    assert_int_equal(renew("a", serial, &request, &answer), RESULT_REFUSED);
    assert_non_null(strstr(answer.err.text, "revoked"));
    X509_free(before);
    X509_free(after);
    release_request(&request);
    release_request(&other);
}

static void once_a_station_is_enrolled_again_its_older_certificates_renew_no_more(void **state) {
    (void)state;
    char stolen[64], renewed[64], present[64];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "a");
    X509 *certificate = enrol_station("a");
    serial_of(certificate, stolen);
    X509_free(certificate);
    assert_int_equal(renew("a", stolen, &request, &answer), RESULT_OK);
    certificate = enrolled_certificate(&answer);
    serial_of(certificate, renewed);
    X509_free(certificate);
    X509_free(enrol_station("b")); // no affair of a's
    assert_int_equal(renew("a", renewed, &request, &answer), RESULT_OK);
    certificate = enrol_station("a");
    serial_of(certificate, present);
    X509_free(certificate);
    assert_int_equal(renew("a", stolen, &request, &answer), RESULT_REFUSED);
    assert_non_null(strstr(answer.err.text, "enrolled again"));
    assert_int_equal(renew("a", renewed, &request, &answer), RESULT_REFUSED);
    assert_int_equal(renew("a", present, &request, &answer), RESULT_OK);
    release_request(&request);
}

static void a_station_that_renews_for_ever_is_stopped(void **state) {
    (void)state;
    char serial[64];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "a");
    X509 *first = enrol_station("a");
    int renewals = 0;
    serial_of(first, serial);
    X509_free(first);
    while (renewals < 100 && renew("a", serial, &request, &answer) == RESULT_OK)
        renewals++;
    assert_int_equal(renewals, 15);
    assert_non_null(strstr(answer.err.text, "16 certificates"));
    release_request(&request);
}

static void the_servers_certificate_is_renewed_for_the_same_key_and_names(void **state) {
    (void)state;
    struct authority_server server;
    char key[4096], key_after[4096], serials[2][64];
    X509 *before = load_certificate("server.pem");
    read_file("server.key", key, sizeof key);
    assert_int_equal(authority_renew_server(dir, NULL, 0, &server, NULL), RESULT_OK);
    X509 *after = load_certificate("server.pem");
    read_file("server.key", key_after, sizeof key_after);
    serial_of(before, serials[0]);
    serial_of(after, serials[1]);
    assert_string_not_equal(serials[0], serials[1]);
    assert_string_equal(key, key_after);
    assert_int_equal(EVP_PKEY_eq(X509_get0_pubkey(before), X509_get0_pubkey(after)), 1);
    assert_int_equal(verdict(after, X509_PURPOSE_SSL_SERVER, "localhost", NULL), X509_V_OK);
    assert_int_equal(verdict(after, X509_PURPOSE_SSL_SERVER, NULL, "127.0.0.1"), X509_V_OK);
    assert_int_equal(verdict(after, X509_PURPOSE_SSL_SERVER, NULL, "::1"), X509_V_OK);
    assert_in_range(days_good(after), 728, 730);
    assert_string_equal(server.hosts[0], "localhost");
    X509_free(before);
    X509_free(after);
}

static void a_renewal_may_change_the_servers_names(void **state) {
    (void)state;
    static const char *const hosts[] = {"hall.example", "10.0.0.5", "fd00::5"};
    static const char *const bad[] = {"a b"};
    struct authority_server server;
    assert_int_equal(authority_renew_server(dir, hosts, 3, &server, NULL), RESULT_OK);
    assert_int_equal(authority_server(dir, &server, NULL), RESULT_OK);
    assert_int_equal(server.host_count, 3);
    for (int i = 0; i < 3; i++)
        assert_string_equal(server.hosts[i], hosts[i]);
    X509 *after = load_certificate("server.pem");
    assert_int_equal(verdict(after, X509_PURPOSE_SSL_SERVER, "hall.example", NULL), X509_V_OK);
    assert_int_equal(verdict(after, X509_PURPOSE_SSL_SERVER, "localhost", NULL),
                     X509_V_ERR_HOSTNAME_MISMATCH);
    X509_free(after);
    assert_int_equal(authority_renew_server(dir, bad, 1, &server, NULL), RESULT_INVALID);
    assert_int_equal(authority_server(dir, &server, NULL), RESULT_OK);
    assert_int_equal(server.host_count, 3);
}

static void revoking_voids_an_open_code_too(void **state) {
    (void)state;
    char code[AUTHORITY_CODE_MAX];
    struct answer answer;
    struct request request = make_request(EVP_EC_gen("P-256"), "a");
    X509_free(enrol_station("a"));
    assert_int_equal(authority_issue_code(dir, "a", code, NULL), RESULT_OK);
    assert_int_equal(authority_revoke(dir, "a", NULL), RESULT_OK);
    assert_int_equal(enrol(code, &request, &answer), RESULT_REFUSED);
    release_request(&request);
}

static void a_station_that_never_was_cannot_be_revoked(void **state) {
    (void)state;
    struct error err = {""};
    assert_int_equal(authority_revoke(dir, "nobody", &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "nobody"));
}

static int64_t until_of(const char *station) {
    int64_t until_s = -1;
    assert_int_equal(authority_station_until(dir, station, &until_s, NULL), RESULT_OK);
    return until_s;
}

static void a_station_is_known_until_its_certificate_ends_or_is_revoked(void **state) {
    (void)state;
    assert_int_equal(until_of("station-1"), 0);
    X509 *certificate = enrol_station("station-1");
    time_t told = (time_t)until_of("station-1");
    int days, seconds;
    ASN1_TIME *until = ASN1_TIME_set(NULL, told);
    assert_int_equal(ASN1_TIME_diff(&days, &seconds, X509_get0_notAfter(certificate), until), 1);
    assert_int_equal(days, 0);
    assert_in_range(abs(seconds), 0, 5);
    ASN1_TIME_free(until);
    X509_free(certificate);
    assert_int_equal(until_of("station-2"), 0);
    assert_int_equal(authority_revoke(dir, "station-1", NULL), RESULT_OK);
    assert_int_equal(until_of("station-1"), 0);
    X509_free(enrol_station("station-1"));
    assert_true(until_of("station-1") > 0);
}

static void a_broken_record_of_revocations_revokes_all(void **state) {
    (void)state;
    static const char *const broken[] = {"A1 12 a\nA2 12", "A1\n", "A1 x a\n", "A1 12 a b\n"};
    X509 *station = enrol_station("a");
    char serial[64];
    serial_of(station, serial);
    X509_free(station);
    for (size_t i = 0; i < sizeof broken / sizeof *broken; i++) {
        write_file("revoked", broken[i]);
        assert_true(is_revoked(serial));
    }
    struct error err = {""};
    assert_int_equal(authority_revoke(dir, "a", &err), RESULT_CORRUPT);
    assert_non_null(strstr(err.text, "revoked: line 1"));
    write_file("revoked", "");
    assert_false(is_revoked(serial));
}

static void a_record_is_read_again_only_after_a_change(void **state) {
    (void)state;
    X509_free(enrol_station("a"));
    struct revocations *nobody = revocations_read(dir, NULL);
    assert_null(revocations_read(dir, nobody));
    assert_int_equal(authority_revoke(dir, "a", NULL), RESULT_OK);
    struct revocations *one = revocations_read(dir, nobody);
    assert_non_null(one);
    assert_null(revocations_read(dir, one));
    write_file("revoked", "A1\n");
    assert_null(revocations_read(dir, one)); // what was known goes on
    struct revocations *all = revocations_read(dir, NULL);
    assert_true(revocations_contain(all, "B2"));
    struct revocations *again = revocations_read(dir, all); // it may be readable by now
    assert_non_null(again);
    write_file("revoked", "");
    struct revocations *mended = revocations_read(dir, one);
    assert_non_null(mended);
    assert_false(revocations_contain(mended, "B2"));
    revocations_release(&nobody);
    revocations_release(&one);
    revocations_release(&all);
    revocations_release(&again);
    revocations_release(&mended);
}

static void of_a_thousand_revoked_each_is_found_and_no_other(void **state) {
    (void)state;
    enum { COUNT = 1000 };
    static char text[COUNT * 32], key[16];
    int used = 0;
    for (int i = 0; i < COUNT; i++) // in no order
        used += snprintf(text + used, sizeof text - (size_t)used, "%X 12 a\n", 2 * (i * 7 % COUNT));
    write_file("revoked", text);
    struct revocations *revocations = revocations_read(dir, NULL);
    for (int i = 0; i < 2 * COUNT; i++) {
        snprintf(key, sizeof key, "%x", i);
        assert_int_equal(revocations_contain(revocations, key), i % 2 == 0);
    }
    revocations_release(&revocations);
}

#define with_authority(test) cmocka_unit_test_setup_teardown(test, make_authority, remove_authority)

int main(void) {
    const struct CMUnitTest tests[] = {
        with_authority(the_server_is_good_for_its_hosts_and_as_a_server_only),
        with_authority(a_station_is_good_as_a_client_only),
        with_authority(the_authority_may_sign_and_lives_ten_years),
        with_authority(serial_numbers_have_128_bits_and_differ),
        with_authority(all_files_are_the_servers_own),
        with_authority(a_second_authority_in_one_folder_is_refused),
        cmocka_unit_test(hosts_that_are_none_are_refused),
        with_authority(a_code_works_once),
        with_authority(a_code_is_good_for_one_name_alone),
        with_authority(a_request_may_leave_its_subject_empty),
        with_authority(a_code_carries_the_fingerprint_of_its_authority),
        with_authority(the_secret_is_not_on_disk),
        with_authority(a_code_lives_fifteen_minutes),
        with_authority(a_new_code_voids_the_one_before_but_not_another_stations),
        with_authority(of_many_who_come_at_once_one_gets_a_certificate),
        with_authority(a_bad_request_is_refused_and_leaves_the_code_good),
        with_authority(names_that_are_none_get_no_code),
        cmocka_unit_test(without_an_authority_there_are_no_codes),
        cmocka_unit_test(a_code_reads_as_a_person_may_type_it),
        cmocka_unit_test(a_mistyped_code_is_told_from_an_unknown_one),
        with_authority(revoking_a_station_ends_all_its_certificates_and_no_others),
        with_authority(a_certificate_that_is_used_revokes_those_before_it),
        with_authority(a_station_renews_by_the_certificate_that_it_has),
        with_authority(once_a_station_is_enrolled_again_its_older_certificates_renew_no_more),
        with_authority(a_station_that_renews_for_ever_is_stopped),
        with_authority(the_servers_certificate_is_renewed_for_the_same_key_and_names),
        with_authority(a_renewal_may_change_the_servers_names),
        with_authority(revoking_voids_an_open_code_too),
        with_authority(a_station_that_never_was_cannot_be_revoked),
        with_authority(a_station_is_known_until_its_certificate_ends_or_is_revoked),
        with_authority(a_broken_record_of_revocations_revokes_all),
        with_authority(a_record_is_read_again_only_after_a_change),
        with_authority(of_a_thousand_revoked_each_is_found_and_no_other),
        with_authority(while_another_is_at_work_nobody_enrols_and_no_code_is_used),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
