// What a provider of a sign-on sends as an ID token: a first byte says whether the rest is the
// token, or the payload of one.
#include "signon/id_token.h"

#include "base/check.h"
#include "fuzz/fuzz.h"

#include <openssl/evp.h>
#include <stdlib.h>
#include <string.h>

static char *token_of(const uint8_t *payload, size_t size) {
    char *token = malloc(2 * size + 16), *at = token;
    CHECK(token);
    *at++ = '.';
    at += EVP_EncodeBlock((uint8_t *)at, payload, (int)size);
    while (at[-1] == '=')
        at--;
    strcpy(at, ".");
    for (char *c = token; *c; c++)
        *c = (char)(*c == '+' ? '-' : *c == '/' ? '_' : *c);
    return token;
}

static void read_token(const char *token) {
    static const struct id_token_wanted wanted = {"https://sso.example.org", "arthron", "n0nce",
                                                  "name"};
    char name[8] = "";
    enum result result = id_token_read(token, &wanted, 100000, name, sizeof name, NULL);
    CHECK(result == RESULT_OK || result == RESULT_FORMAT || result == RESULT_REFUSED);
    CHECK(strlen(name) < sizeof name && (result == RESULT_OK || !name[0]));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (!size)
        return 0;
    char *token =
        data[0] == 'T' ? strndup((const char *)data + 1, size - 1) : token_of(data + 1, size - 1);
    CHECK(token);
    read_token(token);
    free(token);
    return 0;
}
