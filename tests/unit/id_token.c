// The ID token of a provider, and how tokens write bytes.
#include "signon/id_token.h"

#include "signon/base64url.h"
#include "test.h"

#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NOW_S 100000
#define TOKEN_MAX 4096

// ---- base64url ----------------------------------------------------------------------------------

static void bytes_come_back_as_they_were(void **state) {
    (void)state;
    // RFC 4648, 10, without padding; the last needs both letters that base64 has not.
    static const struct {
        const char *text, *bytes;
    } rows[] = {
        {"", ""},           {"Zg", "f"},          {"Zm8", "fo"},          {"Zm9v", "foo"},
        {"Zm9vYg", "foob"}, {"Zm9vYmE", "fooba"}, {"Zm9vYmFy", "foobar"}, {"-_8", "\xfb\xff"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        size_t size;
        char *bytes = base64url_decode(rows[i].text, strlen(rows[i].text), &size);
        assert_non_null(bytes);
        assert_int_equal(size, strlen(rows[i].bytes));
        assert_string_equal(bytes, rows[i].bytes);
        free(bytes);
    }
}

static void what_is_no_base64url_is_refused(void **state) {
    (void)state;
    static const char *const rows[] = {"Z",    "Zm9vY", "Zg==",    "Zm 8",
                                       "Zm9+", "Zm9/",  "Zm9\xc3", "Z.8"};
    size_t size;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        assert_null(base64url_decode(rows[i], strlen(rows[i]), &size));
    assert_null(base64url_decode("Zm\0v", 4, &size));
}

// RFC 7636, appendix B.
static void a_challenge_is_the_hash_of_its_verifier(void **state) {
    (void)state;
    char challenge[BASE64URL_SHA256_MAX];
    base64url_of_sha256("dBjftJeZ4CVP-mB92K27uhbUJU1p1r_wW1gFWFOEjXk", challenge);
    assert_string_equal(challenge, "E9Melhoa2OwvFrEMTJguCHaoeK1t8URWbuGJSstw-cM");
}

// ---- the token ----------------------------------------------------------------------------------

static const char *token_of(const char *payload) {
    static char token[TOKEN_MAX];
    char *at = token + sprintf(token, "eyJhbGciOiJub25lIn0.");
    at += EVP_EncodeBlock((uint8_t *)at, (const uint8_t *)payload, (int)strlen(payload));
    while (at[-1] == '=')
        at--;
    strcpy(at, ".c2ln");
    for (char *c = token; *c; c++)
        *c = (char)(*c == '+' ? '-' : *c == '/' ? '_' : *c);
    return token;
}

static enum result read_for(const char *claim, const char *token, char name[8], struct error *err) {
    const struct id_token_wanted wanted = {"https://sso.example.org", "arthron", "n0nce", claim};
    return id_token_read(token, &wanted, NOW_S, name, 8, err);
}

#define ISS "\"iss\":\"https://sso.example.org\","
#define AUD "\"aud\":\"arthron\","
#define TIMES "\"exp\":100300,\"iat\":99990,"
#define NONCE "\"nonce\":\"n0nce\","
#define NAME "\"name\":\"grace\""

static void a_token_of_this_sign_on_gives_its_name(void **state) {
    (void)state;
    static const char *const rows[] = {
        "{" ISS AUD TIMES NONCE NAME "}",
        "{" ISS "\"aud\":[\"arthron\"]," TIMES NONCE NAME "}",
        "{" ISS AUD "\"azp\":\"arthron\"," TIMES NONCE NAME "}",
        "{" ISS AUD "\"exp\":99941,\"iat\":99341," NONCE NAME
        "}", // clocks differ by less than a minute
        "{" ISS AUD "\"exp\":100300.5,\"iat\":100059," NONCE NAME "}",
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char name[8];
        struct error err;
        assert_ok(read_for("name", token_of(rows[i]), name, &err));
        assert_string_equal(name, "grace");
    }
}

static void any_other_token_is_refused_with_its_fault(void **state) {
    (void)state;
    static const struct {
        const char *payload, *fault;
    } rows[] = {
        {"{" AUD TIMES NONCE NAME "}", "issuer"},
        {"{\"iss\":\"https://sso.example.org/\"," AUD TIMES NONCE NAME "}", "issuer"},
        {"{" ISS TIMES NONCE NAME "}", "client"},
        {"{" ISS "\"aud\":[]," TIMES NONCE NAME "}", "client"},
        {"{" ISS "\"aud\":[\"arthron\",\"other\"]," TIMES NONCE NAME "}", "client"},
        {"{" ISS AUD "\"azp\":\"other\"," TIMES NONCE NAME "}", "client"},
        {"{" ISS AUD "\"azp\":1," TIMES NONCE NAME "}", "client"},
        {"{" ISS AUD "\"iat\":99990," NONCE NAME "}", "time"},
        {"{" ISS AUD "\"exp\":\"100300\",\"iat\":99990," NONCE NAME "}", "time"},
        {"{" ISS AUD "\"exp\":99940,\"iat\":99900," NONCE NAME "}", "time"},
        {"{" ISS AUD "\"exp\":100300,\"iat\":100060," NONCE NAME "}", "time"},
        {"{" ISS AUD "\"exp\":100300,\"iat\":99340," NONCE NAME "}", "time"},
        {"{" ISS AUD TIMES NAME "}", "nonce"},
        {"{" ISS AUD TIMES "\"nonce\":\"n0nce2\"," NAME "}", "nonce"},
        {"{" ISS AUD TIMES NONCE "\"other\":\"grace\"}", "no name"},
        {"{" ISS AUD TIMES NONCE "\"name\":7}", "no name"},
        {"{" ISS AUD TIMES NONCE "\"name\":\"12345678\"}", "no name"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char name[8] = "kept";
        struct error err;
        assert_int_equal(read_for("name", token_of(rows[i].payload), name, &err), RESULT_REFUSED);
        assert_non_null(strstr(err.text, rows[i].fault));
        assert_string_equal(name, "kept");
    }
}

static void an_address_counts_once_it_is_verified(void **state) {
    (void)state;
    char name[8];
    struct error err;
    assert_ok(read_for(
        "email", token_of("{" ISS AUD TIMES NONCE "\"email\":\"g@x.eu\",\"email_verified\":true}"),
        name, &err));
    assert_string_equal(name, "g@x.eu");
    static const char *const rows[] = {"\"email\":\"g@x.eu\"}",
                                       "\"email\":\"g@x.eu\",\"email_verified\":false}",
                                       "\"email\":\"g@x.eu\",\"email_verified\":\"true\"}"};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char payload[512];
        snprintf(payload, sizeof payload, "{" ISS AUD TIMES NONCE "%s", rows[i]);
        assert_int_equal(read_for("email", token_of(payload), name, &err), RESULT_REFUSED);
    }
}

static void what_is_no_token_is_no_token(void **state) {
    (void)state;
    static const char *const rows[] = {"",
                                       ".",
                                       "..",
                                       "a.b",
                                       "a.e30.c.d",
                                       "a.e30=.c",
                                       "a.W10.c",
                                       "a.eyJhIjox.c",
                                       "a.eyJhIjoxLCJhIjoyfQ.c"}; // [], half an object, a key twice
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char name[8];
        struct error err;
        assert_int_equal(read_for("name", rows[i], name, &err), RESULT_FORMAT);
        assert_string_equal(err.text, "the ID token cannot be read");
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_come_back_as_they_were),
        cmocka_unit_test(what_is_no_base64url_is_refused),
        cmocka_unit_test(a_challenge_is_the_hash_of_its_verifier),
        cmocka_unit_test(a_token_of_this_sign_on_gives_its_name),
        cmocka_unit_test(any_other_token_is_refused_with_its_fault),
        cmocka_unit_test(an_address_counts_once_it_is_verified),
        cmocka_unit_test(what_is_no_token_is_no_token),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
