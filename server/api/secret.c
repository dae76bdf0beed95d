#include "api/secret.h"

#include "base/check.h"

#include <ctype.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

static const char letters[] = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789";

static void write_hex(const uint8_t bytes[32], char out[SECRET_MAX]) {
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", bytes[i]);
}

void secret_make(char out_secret[SECRET_MAX]) {
    uint8_t bytes[32];
    ssize_t got = getrandom(bytes, sizeof bytes, 0);
    CHECK(got == sizeof bytes);
    write_hex(bytes, out_secret);
}

void secret_make_code(char out_code[SECRET_CODE_MAX]) {
    uint8_t bytes[SECRET_CODE_MAX - 1];
    ssize_t got = getrandom(bytes, sizeof bytes, 0);
    CHECK(got == sizeof bytes);
    for (size_t i = 0; i < sizeof bytes; i++)
        out_code[i] = letters[bytes[i] % 32];
    out_code[sizeof bytes] = '\0';
}

bool secret_read_code(const char *typed, char out_code[SECRET_CODE_MAX]) {
    size_t count = 0;
    for (; *typed; typed++) {
        if (*typed == ' ' || *typed == '-')
            continue;
        char letter = (char)toupper((unsigned char)*typed);
        if (!strchr(letters, letter) || count == SECRET_CODE_MAX - 1)
            return false;
        out_code[count++] = letter;
    }
    out_code[count] = '\0';
    return count == SECRET_CODE_MAX - 1;
}

void secret_hash(const char *secret, char out_hash[SECRET_MAX]) {
    uint8_t hash[32];
    int done = EVP_Digest(secret, strlen(secret), hash, NULL, EVP_sha256(), NULL);
    NEED(done == 1, "memory");
    write_hex(hash, out_hash);
}

bool secret_is(const char *secret, const char *given) {
    char hashes[2][SECRET_MAX];
    secret_hash(secret, hashes[0]);
    secret_hash(given, hashes[1]);
    return !CRYPTO_memcmp(hashes[0], hashes[1], SECRET_MAX);
}
