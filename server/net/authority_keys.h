// Keys and certificates in the authority's folder, as files.
#pragma once

#include "base/result.h"
#include "net/certificate.h"

#include <stdint.h>

// Takes the bytes of a BIO of memory, which it frees.
enum result authority_write_memory(const char *dir, const char *name, BIO *memory,
                                   struct error *err);
enum result authority_write_key(const char *dir, const char *name, EVP_PKEY *key,
                                struct error *err);
enum result authority_write_certificate(const char *dir, const char *name, X509 *certificate,
                                        struct error *err);

// NULL if there is no readable one. The caller frees it.
X509 *authority_read_certificate(const char *dir, const char *name);
EVP_PKEY *authority_read_key(const char *dir, const char *name);

// The authority's certificate and key. RESULT_MISSING; RESULT_CORRUPT: they do not match. Release
// it after an error too.
enum result issuer_read(const char *dir, struct issuer *out_issuer, struct error *err);
void issuer_release(struct issuer *issuer);
