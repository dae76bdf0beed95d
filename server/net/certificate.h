// Keys and X.509 certificates of the authority: EC P-256, SHA-256, random serial numbers of 128
// bits. Types are OpenSSL's. The caller frees results with OpenSSL's functions. Functions that make
// something do not fail: OpenSSL could only run out of memory.
#pragma once

#include <openssl/x509.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CERTIFICATE_AUTHORITY_DAYS (10 * 365)
#define CERTIFICATE_DAYS (2 * 365) // of the others

enum certificate_use {
    CERTIFICATE_AUTHORITY, // CA:TRUE
    CERTIFICATE_SERVER,    // serverAuth
    CERTIFICATE_STATION    // clientAuth
};

struct issuer {
    X509 *certificate;
    EVP_PKEY *key;
};

EVP_PKEY *certificate_key(void);

// A certificate ends with its issuer's at the latest. `alternative_names`: as in OpenSSL's
// subjectAltName ("DNS:...,IP:..."), NULL for none. `issuer` NULL: signed with `key` itself, which
// must then have its private part.
X509 *certificate_make(enum certificate_use use, const char *common_name,
                       const char *alternative_names, EVP_PKEY *key, const struct issuer *issuer);

#define CERTIFICATE_NAME_SIZE 64

// The key of a PKCS #10 request, and the common name that it asks for (may be empty). NULL unless
// the request is well-formed, signed by its key, and EC P-256.
EVP_PKEY *certificate_request_key(const uint8_t *request_der, size_t size,
                                  char out_name[CERTIFICATE_NAME_SIZE]);

int64_t certificate_end(const X509 *certificate); // seconds since 1970; 0: it says none

// The host names and addresses of a server's certificate, at most `max`. Returns their number.
int certificate_hosts(const X509 *certificate, char (*out_hosts)[256], int max);

#define CERTIFICATE_SERIAL_SIZE 48
void certificate_serial(const X509 *certificate, char out_hex[CERTIFICATE_SERIAL_SIZE]);
