// Keys and certificates in the authority's folder, as files.
#pragma once

#include "base/result.h"
#include "net/certificate.h"

#include <stdint.h>

enum result authority_write_key(const char *dir, const char *name, EVP_PKEY *key,
                                struct error *err);
enum result authority_write_certificate(const char *dir, const char *name, X509 *certificate,
                                        struct error *err);

// NULL where there is none that can be read. The caller's.
X509 *authority_read_certificate(const char *dir, const char *name);
EVP_PKEY *authority_read_key(const char *dir, const char *name);

// The authority itself: RESULT_MISSING, or RESULT_CORRUPT where its key is another one's. Release
// it after an error too.
enum result issuer_read(const char *dir, struct issuer *out_issuer, struct error *err);
void issuer_release(struct issuer *issuer);
