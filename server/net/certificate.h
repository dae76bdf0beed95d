// Keys and X.509 certificates of the authority: EC P-256, SHA-256, random serial numbers of 128
// bits. Types are OpenSSL's; what is returned is the caller's, to be freed with OpenSSL's
// functions. Functions that make something do not fail: there OpenSSL can only run out of memory.
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

// No certificate outlives its issuer's.
// `alternative_names` as OpenSSL's subjectAltName takes them ("DNS:...,IP:..."), NULL for none;
// `issuer` NULL: signed with its own key, which must be a whole one then.
X509 *certificate_make(enum certificate_use use, const char *common_name,
                       const char *alternative_names, EVP_PKEY *key, const struct issuer *issuer);

#define CERTIFICATE_NAME_SIZE 64

// The key of a PKCS #10 request that is well-formed, signed by that key, and EC P-256, and the
// common name that it asks for (empty where it names none). Else NULL.
EVP_PKEY *certificate_request_key(const uint8_t *request_der, size_t size,
                                  char out_name[CERTIFICATE_NAME_SIZE]);

int64_t certificate_end(const X509 *certificate); // seconds since 1970; 0: it says none

// The host names and addresses that a server's certificate is for, at most `max`; how many.
int certificate_hosts(const X509 *certificate, char (*out_hosts)[256], int max);

#define CERTIFICATE_SERIAL_SIZE 48
void certificate_serial(const X509 *certificate, char out_hex[CERTIFICATE_SERIAL_SIZE]);
