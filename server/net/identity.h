// The identity of a TLS connection's peer, from its certificate.
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

// Call it after the handshake. A certificate with a too long name or serial number does not count.
void identity_of(const struct ssl_st *connection, struct identity *out_identity);

// Allows TLS 1.3 only. Requests client certificates and checks them against the trusted ones of
// `context`; a client may have none. *refused counts invalid ones; it must outlive the context.
void identity_ask(struct ssl_ctx_st *context, atomic_uint_fast64_t *refused);
