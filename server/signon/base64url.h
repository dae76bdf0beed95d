// Base64 as URLs and tokens have it (RFC 4648, 5), without padding.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BASE64URL_SHA256_MAX 44

void base64url_of_sha256(const char *text, char out[BASE64URL_SHA256_MAX]);

// The bytes of `length` characters, with a 0 behind them; the caller frees them. NULL: it is no
// base64url.
char *base64url_decode(const char *text, size_t length, size_t *out_size);
