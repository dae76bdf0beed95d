// Passwords by argon2id: 64 MiB, 3 passes, one lane (above what OWASP asks for). From any threads;
// two at a time are worked on, the others wait, so that signing in takes 128 MiB at most.
#pragma once

#include "base/result.h"

#include <stdbool.h>

#define PASSWORD_LEAST 10    // characters
#define PASSWORD_MOST 1024   // bytes; none is ever cut
#define PASSWORD_ENCODED 128 // with salt and cost, as argon2 writes it

// RESULT_INVALID: too short, too long, or no UTF-8.
enum result password_check(const char *password, struct error *err);

// With a salt of its own: twice the same password is not the same text.
void password_encode(const char *password, char out_encoded[PASSWORD_ENCODED]);

// encoded NULL: there is no such account. False after the same time as for any other.
bool password_is(const char *encoded, const char *password);
