// The authority's private key, which may be encrypted: PKCS #8, AES-256, with a key that scrypt
// makes of a passphrase. It lies in the authority's folder, or in one of its own.
#pragma once

#include "base/result.h"
#include "net/certificate.h"

#include <stdbool.h>

// RESULT_MISSING: it is not there. RESULT_INVALID: it is encrypted, and its passphrase is missing
// or wrong. RESULT_CORRUPT: it is no private key. The caller frees *out_key.
enum result authority_secret_read(const char *dir, EVP_PKEY **out_key, bool *out_encrypted,
                                  struct error *err);

// Encrypted if there is a passphrase.
enum result authority_secret_write(const char *dir, EVP_PKEY *key, struct error *err);
