// Sign-on at a provider of OpenID Connect, by a code (Core, 3.1) and PKCE (RFC 7636): where a
// browser goes to, and whose name comes back. No sockets of browsers, no cookies, no accounts.
#pragma once

#include "base/result.h"
#include "signon/settings.h"

#include <stdbool.h>
#include <stddef.h>

#define SIGNON_SECRET_MAX 65
#define SIGNON_URL_MAX 2048
#define SIGNON_WORD_MAX 41

struct signon;

// Asks nobody yet. settings: copied. RESULT_INVALID: the issuer. RESULT_MISSING: a file.
enum result signon_create(const struct signon_settings *settings, struct signon **out_signon,
                          struct error *err);
// Ends what waits for the provider: RESULT_CLOSED.
void signon_break_off(struct signon *signon);
void signon_destroy(struct signon **signon); // NULL inside is fine

const char *signon_name(const struct signon *signon); // what the button says

// A place to speak with the provider, of four: so one that is slow takes no more threads. False:
// all are taken. What follows needs one.
bool signon_take_place(struct signon *signon);
void signon_leave_place(struct signon *signon);

// Of one sign-on; 43 to 64 letters, digits and "-._~" each. redirect: where the provider sends the
// browser back to, the same at the begin and at the end.
struct signon_secrets {
    char state[SIGNON_SECRET_MAX], nonce[SIGNON_SECRET_MAX], verifier[SIGNON_SECRET_MAX];
};

// Where the browser has to go. One line of printable ASCII. From any thread, as signon_end.
enum result signon_begin(struct signon *signon, const struct signon_secrets *secrets,
                         const char *redirect, char out_url[SIGNON_URL_MAX], struct error *err);

// Whose code it is, by the claim of the config. RESULT_REFUSED: the provider does not take the
// code, or its ID token is not good. Else, but for RESULT_CLOSED, the provider does not work as it
// should.
enum result signon_end(struct signon *signon, const struct signon_secrets *secrets,
                       const char *redirect, const char *code, char *out_name, size_t size,
                       struct error *err);

// Whether a log may tell it: a word for an error, as RFC 6749 (4.1.2.1 and 5.2) has them.
bool signon_is_word(const char *text);
