// A server's certificate and key on disk, which somebody may replace while the server runs (an
// operator who renews it, or certbot). One thread at a time.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

struct ssl_ctx_st; // OpenSSL's SSL_CTX, X509 and EVP_PKEY
struct x509_st;
struct evp_pkey_st;

#define TLS_WARNING_DAYS 30

// Certificate, chain and key, as they were read: whole, and fitting each other.
struct tls_credentials;

void tls_credentials_destroy(struct tls_credentials **credentials); // NULL inside is fine

// New connections of `context` show them; those that are open keep what they have.
void tls_credentials_use(const struct tls_credentials *credentials, struct ssl_ctx_st *context);

// Their own, and last as long as the credentials do.
struct x509_st *tls_credentials_certificate(const struct tls_credentials *credentials);
struct evp_pkey_st *tls_credentials_key(const struct tls_credentials *credentials);

struct tls_files;

// Certificate (PEM, the chain behind it) and key of files that can be used: RESULT_MISSING or
// RESULT_FORMAT name the one at fault. The caller releases both; out_credentials may be NULL.
enum result tls_files_create(const char *certificate, const char *key, struct tls_files **out_files,
                             struct tls_credentials **out_credentials, struct error *err);
void tls_files_destroy(struct tls_files **files); // NULL inside is fine

// What is there now, where it is new since tls_files_create and the last look, and key and
// certificate fit each other: the caller's. Else NULL; what is wrong with new files is logged once.
struct tls_credentials *tls_files_look(struct tls_files *files);

// Logs, once a day and after each renewal, that the certificate ends within TLS_WARNING_DAYS.
// room: who logs; advice: how to renew it, for a person.
void tls_files_warn(struct tls_files *files, const char *room, const char *advice);
