#include "wire/code.h"

#include "base/check.h"

#include <ctype.h>
#include <openssl/evp.h>
#include <stdbool.h>
#include <string.h>

#define CODE_BYTES (CODE_SECRET_SIZE + CODE_FINGERPRINT_SIZE + 1)
#define CHARACTERS (CODE_BYTES * 8 / 5)
#define GROUP 6

_Static_assert(CODE_BYTES % 5 == 0, "base32 without padding");
_Static_assert(CHARACTERS + CHARACTERS / GROUP <= CODE_TEXT_MAX, "the text fits");

static const char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ234567";

static void sha256(const void *data, size_t size, uint8_t out_hash[32]) {
    int done = EVP_Digest(data, size, out_hash, NULL, EVP_sha256(), NULL);
    NEED(done == 1, "memory");
}

static uint8_t check_byte(const uint8_t bytes[CODE_BYTES]) {
    uint8_t hash[32];
    sha256(bytes, CODE_BYTES - 1, hash);
    return hash[0];
}

void code_write(const struct code *code, char out_text[CODE_TEXT_MAX]) {
    uint8_t bytes[CODE_BYTES];
    memcpy(bytes, code->secret, CODE_SECRET_SIZE);
    memcpy(bytes + CODE_SECRET_SIZE, code->fingerprint, CODE_FINGERPRINT_SIZE);
    bytes[CODE_BYTES - 1] = check_byte(bytes);
    for (int i = 0; i < CHARACTERS; i++) {
        unsigned value = 0;
        for (int bit = 5 * i; bit < 5 * i + 5; bit++)
            value = value << 1 | (bytes[bit / 8] >> (7 - bit % 8) & 1);
        if (i && i % GROUP == 0)
            *out_text++ = '-';
        *out_text++ = alphabet[value];
    }
    *out_text = 0;
}

// The value of a character as a person may type it, -1 for none.
static int value_of(char typed) {
    char c = (char)toupper((unsigned char)typed);
    c = c == '0' ? 'O' : c == '1' ? 'I' : c == '8' ? 'B' : c;
    const char *found = c ? strchr(alphabet, c) : NULL;
    return found ? (int)(found - alphabet) : -1;
}

static bool read_characters(const char *text, uint8_t out_bytes[CODE_BYTES]) {
    int count = 0;
    memset(out_bytes, 0, CODE_BYTES);
    for (; *text; text++) {
        if (*text == '-' || isspace((unsigned char)*text))
            continue;
        int value = value_of(*text);
        if (value < 0 || count == CHARACTERS)
            return false;
        for (int i = 0, bit = 5 * count; i < 5; i++, bit++)
            out_bytes[bit / 8] |= (uint8_t)((value >> (4 - i) & 1) << (7 - bit % 8));
        count++;
    }
    return count == CHARACTERS;
}

enum result code_read(const char *text, struct code *out_code, struct error *err) {
    uint8_t bytes[CODE_BYTES];
    if (!read_characters(text, bytes))
        return fail(err, RESULT_FORMAT, "the code is not %d letters and digits", CHARACTERS);
    if (bytes[CODE_BYTES - 1] != check_byte(bytes))
        return fail(err, RESULT_FORMAT, "the code is mistyped: its check does not match");
    memcpy(out_code->secret, bytes, CODE_SECRET_SIZE);
    memcpy(out_code->fingerprint, bytes + CODE_SECRET_SIZE, CODE_FINGERPRINT_SIZE);
    return RESULT_OK;
}

void code_fingerprint(const uint8_t *certificate_der, size_t size,
                      uint8_t out_fingerprint[CODE_FINGERPRINT_SIZE]) {
    uint8_t hash[32];
    sha256(certificate_der, size, hash);
    memcpy(out_fingerprint, hash, CODE_FINGERPRINT_SIZE);
}
