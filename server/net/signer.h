// Signs with the server's key, so that the authority's certificate proves that this server wrote
// the bytes. Any number of threads may use one signer.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct signer;

// Key and certificate of the server in the authority's folder (authority.h).
enum result signer_create(const char *authority_dir, struct signer **out_signer, struct error *err);
void signer_destroy(struct signer **signer); // NULL inside is fine

// Gives an ECDSA signature with SHA-256 and the certificate (X.509) for checking it, both DER. It
// reads renewed keys and certificates from disk. `signer` is a struct signer. False: one of the two
// is too large for its memory.
bool signer_sign(void *signer, const uint8_t *message, size_t size, uint8_t *out_certificate,
                 size_t *in_out_certificate_size, uint8_t *out_signature,
                 size_t *in_out_signature_size);
