// Secrets that are made by chance, and what of them may be kept.
#pragma once

#include <stdbool.h>

#define SECRET_MAX 65 // 256 bits in hexadecimal digits
#define SECRET_CODE_MAX 9

void secret_make(char out_secret[SECRET_MAX]);

// 40 bits that a person types: 8 of 32 letters and digits that are hard to take for each other.
void secret_make_code(char out_code[SECRET_CODE_MAX]);

// A code as it was made, of one as it was typed: small letters, blanks and hyphens are fine. False
// where it can be none.
bool secret_read_code(const char *typed, char out_code[SECRET_CODE_MAX]);

// Its SHA-256, in hexadecimal digits.
void secret_hash(const char *secret, char out_hash[SECRET_MAX]);

// The time that it takes tells nothing.
bool secret_is(const char *secret, const char *given);
