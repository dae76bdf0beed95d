// Random secrets, and their hashes, which may be stored.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

#define SECRET_MAX 65 // 256 bits in hexadecimal digits
#define SECRET_CODE_MAX 9

void secret_make(char out_secret[SECRET_MAX]);

// 40 bits for a person to type: 8 characters out of 32 that are easy to tell apart.
void secret_make_code(char out_code[SECRET_CODE_MAX]);

// Normalizes a typed code: case, blanks and hyphens do not matter. False if it cannot be a code.
bool secret_read_code(const char *typed, char out_code[SECRET_CODE_MAX]);

// Its SHA-256, in hexadecimal digits.
void secret_hash(const char *secret, char out_hash[SECRET_MAX]);

// A key of the server, in a file that its user alone may read.
#define SECRET_KEY_SIZE 32
struct secret_key {
    uint8_t bytes[SECRET_KEY_SIZE];
};

// Reads the file web.key of a folder; makes it if it is not there. RESULT_IO, RESULT_FORMAT.
enum result secret_key_load(const char *dir, struct secret_key *out_key, struct error *err);

// The HMAC-SHA-256 of a purpose and a text, in hexadecimal digits. What is short enough to be
// guessed from its hash needs the key.
void secret_keyed_hash(const struct secret_key *key, const char *purpose, const char *text,
                       char out_hash[SECRET_MAX]);

// Compares in constant time.
bool secret_is(const char *secret, const char *given);
