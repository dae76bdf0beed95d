// The one-time code that a person carries from the server to a new station. It holds a secret that
// nobody else should know, and the fingerprint of the server's authority, so that the station can
// tell its server from any other before it has a certificate.
//
// Text: base32 (RFC 4648, no padding) of secret, fingerprint and one byte of check, 48 characters
// in groups of six with dashes between. Reading takes small letters, dashes and blanks anywhere,
// and 0, 1 and 8 for O, I and B.
#pragma once

#include "base/result.h"

#include <stdint.h>

#define CODE_SECRET_SIZE 13      // 104 bits
#define CODE_FINGERPRINT_SIZE 16 // first 128 bits of SHA-256 of the authority's certificate (DER)
#define CODE_TEXT_MAX 64

struct code {
    uint8_t secret[CODE_SECRET_SIZE];
    uint8_t fingerprint[CODE_FINGERPRINT_SIZE];
};

void code_write(const struct code *code, char out_text[CODE_TEXT_MAX]);

// RESULT_FORMAT where the text is no code or was mistyped; the error does not repeat it.
enum result code_read(const char *text, struct code *out_code, struct error *err);

// Compare with a code's by CRYPTO_memcmp.
void code_fingerprint(const uint8_t *certificate_der, size_t size,
                      uint8_t out_fingerprint[CODE_FINGERPRINT_SIZE]);
