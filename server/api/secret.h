// Random secrets, and their hashes, which may be stored.
#pragma once

#include <stdbool.h>

#define SECRET_MAX 65 // 256 bits in hexadecimal digits
#define SECRET_CODE_MAX 9

void secret_make(char out_secret[SECRET_MAX]);

// 40 bits for a person to type: 8 characters out of 32 that are easy to tell apart.
void secret_make_code(char out_code[SECRET_CODE_MAX]);

// Normalizes a typed code: case, blanks and hyphens do not matter. False if it cannot be a code.
bool secret_read_code(const char *typed, char out_code[SECRET_CODE_MAX]);

// Its SHA-256, in hexadecimal digits.
void secret_hash(const char *secret, char out_hash[SECRET_MAX]);

// Compares in constant time.
bool secret_is(const char *secret, const char *given);
