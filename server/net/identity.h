// Who is at the other end of a TLS connection, as its certificate says.
#pragma once

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

struct ssl_st;     // OpenSSL's SSL
struct ssl_ctx_st; // OpenSSL's SSL_CTX

struct identity {
    bool certified;  // the peer showed a certificate of our authority
    char name[64];   // its common name
    char serial[64]; // hexadecimal, as registrar_is_revoked takes it
    int64_t until_s; // when it ends, seconds since 1970
};

// After the handshake. A certificate whose name or serial number does not fit counts as none.
void identity_of(const struct ssl_st *connection, struct identity *out_identity);

// TLS 1.3 only; client certificates are asked for and checked against the trusted ones of
// `context`, but a client may come without. `refused` counts those that are not good; it outlives
// the context.
void identity_ask(struct ssl_ctx_st *context, atomic_uint_fast64_t *refused);
