// A server's certificate and key on disk. An operator or certbot may replace them while the server
// runs. One thread at a time.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stdint.h>

struct ssl_ctx_st; // OpenSSL's SSL_CTX, X509 and EVP_PKEY
struct x509_st;
struct evp_pkey_st;

#define TLS_WARNING_DAYS 30

// Certificate, chain and key from one reading: whole and matching.
struct tls_credentials;

void tls_credentials_destroy(struct tls_credentials **credentials); // NULL inside is fine

// New connections of `context` use them; open connections do not change.
void tls_credentials_use(const struct tls_credentials *credentials, struct ssl_ctx_st *context);

// The credentials own these.
struct x509_st *tls_credentials_certificate(const struct tls_credentials *credentials);
struct evp_pkey_st *tls_credentials_key(const struct tls_credentials *credentials);

struct tls_files;

// Reads the certificate (PEM, followed by the chain) and the key. RESULT_MISSING or RESULT_FORMAT
// name the file at fault. The caller releases both results; out_credentials may be NULL.
enum result tls_files_create(const char *certificate, const char *key, struct tls_files **out_files,
                             struct tls_credentials **out_credentials, struct error *err);
void tls_files_destroy(struct tls_files **files); // NULL inside is fine

// The new credentials, if the files have changed since tls_files_create and the last look, and key
// and certificate match. The caller releases them. Otherwise NULL; faults of new files are logged
// once.
struct tls_credentials *tls_files_look(struct tls_files *files);

// The end of the certificate, in seconds since 1970.
int64_t tls_files_end_s(const struct tls_files *files);

// Logs, once a day and after each renewal, that the certificate ends within TLS_WARNING_DAYS.
// room: for the log line; advice: how to renew it, for a person.
void tls_files_warn(struct tls_files *files, const char *room, const char *advice);
