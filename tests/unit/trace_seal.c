#include "folder.h"
#include "net/authority.h"
#include "net/authority_keys.h"
#include "net/signer.h"
#include "test.h"
#include "unit/trace_files.h"
#include "unit/trace_mend.h"

#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static char keys[2][FOLDER_MAX], authority[2][256]; // ours, and one that we do not know
static struct signer *signers[2];
static struct trace_signer vouches[2];
static char signed_by[TRACE_SIGNED_BY_MAX]; // of the last check

static int make_keys(void **state) {
    const char *hosts[] = {"localhost"};
    for (int i = 0; i < 2; i++) {
        folder_make(keys[i]);
        folder_remove(keys[i]); // the authority makes it
        if (authority_init(keys[i], hosts, 1, NULL) != RESULT_OK ||
            signer_create(keys[i], &signers[i], NULL) != RESULT_OK)
            return -1;
        snprintf(authority[i], sizeof authority[i], "%s/authority.pem", keys[i]);
        vouches[i].sign = signer_sign;
        vouches[i].context = signers[i];
    }
    return make_folder(state);
}

static int remove_keys(void **state) {
    for (int i = 0; i < 2; i++) {
        signer_destroy(&signers[i]);
        folder_remove(keys[i]);
    }
    return remove_folder(state);
}

static int64_t now_ns(void) {
    return (int64_t)time(NULL) * 1000000000;
}

static void write_signed(const struct trace_signer *signer) {
    struct trace_header header = some_header();
    struct trace_writer *writer;
    unlink(path);
    assert_int_equal(trace_writer_create(path, &header, signer, NULL, &writer, NULL), RESULT_OK);
    for (uint64_t n = 1; n <= 5; n++)
        assert_true(append_step(writer, n));
    trace_writer_destroy(&writer);
}

// RESULT_CLOSED where there is no seal, or what ended reading.
static enum result check(const char *from, const char *trusted, int64_t utc_ns, struct error *err) {
    struct trace_reader *reader;
    struct trace_record record;
    struct trace_seal seal;
    enum result result = trace_reader_create(from, &reader, err);
    if (result != RESULT_OK)
        return result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK)
        continue;
    if (result == RESULT_CLOSED && trace_reader_seal(reader, &seal)) {
        result = trace_seal_check(&seal, trusted, utc_ns, signed_by, err);
        if (result == RESULT_OK)
            assert_int_equal(strncmp(signed_by, "Arthron server, certificate ", 28), 0);
    }
    trace_reader_destroy(&reader);
    return result;
}

static void a_closed_trace_is_signed_by_the_servers_key(void **state) {
    (void)state;
    struct error err = {""};
    write_signed(&vouches[0]);
    assert_int_equal(check(path, authority[0], now_ns(), &err), RESULT_OK);
    assert_int_equal(check(path, NULL, now_ns(), &err), RESULT_OK);
    assert_int_equal(check(path, authority[1], now_ns(), &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, authority[1]));
    assert_int_equal(check(path, "/nowhere.pem", now_ns(), &err), RESULT_IO);
    int64_t years = (int64_t)365 * 86400 * 1000000000;
    assert_int_equal(check(path, authority[0], now_ns() + 3 * years, &err), RESULT_REFUSED);
}

struct holder {
    X509 *certificate;
    EVP_PKEY *key;
};

static bool sign_as_holder(void *context, const uint8_t *message, size_t size,
                           uint8_t *out_certificate, size_t *in_out_certificate_size, uint8_t *out,
                           size_t *in_out_size) {
    const struct holder *holder = context;
    EVP_MD_CTX *signing = EVP_MD_CTX_new();
    *in_out_certificate_size = (size_t)i2d_X509(holder->certificate, &out_certificate);
    bool done = EVP_DigestSignInit(signing, NULL, EVP_sha256(), NULL, holder->key) == 1 &&
                EVP_DigestSign(signing, out, in_out_size, message, size) == 1;
    EVP_MD_CTX_free(signing);
    return done;
}

static void a_stations_certificate_signs_no_trace(void **state) {
    (void)state;
    struct issuer issuer;
    struct error err = {""};
    assert_int_equal(issuer_read(keys[0], &issuer, &err), RESULT_OK);
    for (int use = CERTIFICATE_SERVER; use <= CERTIFICATE_STATION; use++) {
        struct holder holder = {.key = certificate_key()};
        struct trace_signer vouch = {sign_as_holder, &holder};
        holder.certificate = certificate_make((enum certificate_use)use, "Arthron server", NULL,
                                              holder.key, &issuer);
        write_signed(&vouch);
        assert_int_equal(check(path, authority[0], now_ns(), &err),
                         use == CERTIFICATE_SERVER ? RESULT_OK : RESULT_REFUSED);
        X509_free(holder.certificate);
        EVP_PKEY_free(holder.key);
    }
    assert_non_null(strstr(err.text, "not issued to a server"));
    issuer_release(&issuer);
}

static void a_trace_without_a_signer_has_no_seal(void **state) {
    (void)state;
    write_signed(NULL);
    assert_int_equal(check(path, authority[0], now_ns(), NULL), RESULT_CLOSED);
}

static bool cannot_sign(void *context, const uint8_t *message, size_t size,
                        uint8_t *out_certificate, size_t *in_out_certificate_size, uint8_t *out,
                        size_t *in_out_size) {
    (void)context, (void)message, (void)size, (void)out_certificate, (void)in_out_certificate_size;
    (void)out, (void)in_out_size;
    return false;
}

static void a_signer_that_fails_leaves_a_whole_trace(void **state) {
    (void)state;
    struct trace_signer broken = vouches[0];
    broken.sign = cannot_sign;
    write_signed(&broken);
    assert_int_equal(check(path, authority[0], now_ns(), NULL), RESULT_CLOSED);
}

// A forger who puts right every hash has not the key.
static void what_was_changed_afterwards_is_refused_even_with_right_hashes(void **state) {
    (void)state;
    write_signed(&vouches[0]);
    static uint8_t data[1 << 16];
    FILE *file = fopen(path, "rb");
    size_t size = fread(data, 1, sizeof data, file);
    fclose(file);
    data[14] ^= 1; // the session's id, in the header
    trace_mend(data, size);
    file = fopen(copy_path, "wb");
    fwrite(data, 1, size, file);
    fclose(file);
    struct error err = {""};
    assert_int_equal(check(copy_path, NULL, now_ns(), &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "signature is wrong"));
}

static void a_renewed_certificate_signs_what_is_closed_from_then_on(void **state) {
    (void)state;
    struct authority_server server;
    char before[TRACE_SIGNED_BY_MAX];
    write_signed(&vouches[0]);
    assert_int_equal(check(path, authority[0], now_ns(), NULL), RESULT_OK);
    strcpy(before, signed_by);
    assert_int_equal(authority_renew_server(keys[0], NULL, 0, &server, NULL), RESULT_OK);
    write_signed(&vouches[0]);
    assert_int_equal(check(path, authority[0], now_ns(), NULL), RESULT_OK);
    assert_string_not_equal(before, signed_by);
}

static void keys_that_do_not_belong_together_are_refused(void **state) {
    (void)state;
    char from[160], to[160];
    struct signer *signer = NULL;
    struct error err = {""};
    assert_int_equal(signer_create("/nowhere", &signer, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, "/nowhere/server.pem"));
    snprintf(from, sizeof from, "%s/server.pem", keys[1]);
    snprintf(to, sizeof to, "%s/server.pem", keys[0]);
    assert_int_equal(rename(from, to), 0);
    assert_int_equal(signer_create(keys[0], &signer, &err), RESULT_FORMAT);
    assert_null(signer);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_closed_trace_is_signed_by_the_servers_key),
        cmocka_unit_test(a_stations_certificate_signs_no_trace),
        cmocka_unit_test(a_trace_without_a_signer_has_no_seal),
        cmocka_unit_test(a_signer_that_fails_leaves_a_whole_trace),
        cmocka_unit_test(a_renewed_certificate_signs_what_is_closed_from_then_on),
        cmocka_unit_test(what_was_changed_afterwards_is_refused_even_with_right_hashes),
        cmocka_unit_test(keys_that_do_not_belong_together_are_refused),
    };
    return cmocka_run_group_tests_name("trace_seal", tests, make_keys, remove_keys);
}
