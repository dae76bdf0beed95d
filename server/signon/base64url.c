#include "signon/base64url.h"

#include "base/check.h"

#include <openssl/evp.h>
#include <stdlib.h>
#include <string.h>

void base64url_of_sha256(const char *text, char out[BASE64URL_SHA256_MAX]) {
    uint8_t hash[32];
    char encoded[BASE64URL_SHA256_MAX + 1]; // with one '=' at its end
    int done = EVP_Digest(text, strlen(text), hash, NULL, EVP_sha256(), NULL);
    NEED(done == 1, "memory");
    EVP_EncodeBlock((uint8_t *)encoded, hash, sizeof hash);
    for (int i = 0; i < BASE64URL_SHA256_MAX - 1; i++)
        out[i] = (char)(encoded[i] == '+' ? '-' : encoded[i] == '/' ? '_' : encoded[i]);
    out[BASE64URL_SHA256_MAX - 1] = '\0';
}

static bool is_base64url(const char *text, size_t length) {
    static const char letters[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    return length % 4 != 1 && strspn(text, letters) >= length;
}

char *base64url_decode(const char *text, size_t length, size_t *out_size) {
    if (!is_base64url(text, length))
        return NULL;
    size_t padding = (4 - length % 4) % 4, whole = length + padding;
    char *encoded = alloc(whole + 1, 1), *out = alloc(whole + 1, 1);
    for (size_t i = 0; i < length; i++)
        encoded[i] = (char)(text[i] == '-' ? '+' : text[i] == '_' ? '/' : text[i]);
    memset(encoded + length, '=', padding);
    int size = EVP_DecodeBlock((uint8_t *)out, (const uint8_t *)encoded, (int)whole);
    free(encoded);
    CHECK(size >= (int)padding); // all letters are good
    *out_size = (size_t)size - padding;
    out[*out_size] = '\0';
    return out;
}
