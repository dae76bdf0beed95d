// What the server's config says of sign-on.
#pragma once

#define SIGNON_TEXT_MAX 256
#define SIGNON_NAME_MAX 64

// The section [sign_on] of the server's config.
struct signon_settings {
    char issuer[SIGNON_TEXT_MAX]; // of the provider; empty: no sign-on
    char client_id[SIGNON_TEXT_MAX];
    char client_secret[SIGNON_TEXT_MAX]; // a file; empty: a client without a secret
    char name[SIGNON_NAME_MAX];          // what the button says
    char claim[SIGNON_NAME_MAX];         // of the ID token: the account's name
    char authority[SIGNON_TEXT_MAX];     // a PEM file; empty: the system's authorities
};
