// Signs with the server's key, so that others can tell by the authority's certificate what this
// server wrote. Any number of threads may use one.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct signer;

// Key and certificate of the server in the authority's folder (authority.h).
enum result signer_create(const char *authority_dir, struct signer **out_signer, struct error *err);
void signer_destroy(struct signer **signer); // NULL inside is fine

// ECDSA with SHA-256, and the certificate (X.509) that it is to be checked with, both DER: the
// server's as they are on disk now, where they were renewed. `signer` is a struct signer. False
// where one of them is too large for its place.
bool signer_sign(void *signer, const uint8_t *message, size_t size, uint8_t *out_certificate,
                 size_t *in_out_certificate_size, uint8_t *out_signature,
                 size_t *in_out_signature_size);
