// Passwords, encoded by argon2id with 64 MiB, 3 passes and one lane (more than OWASP requires). Any
// thread may call. Two calls run at a time and the others wait, so sign-ins take at most 128 MiB.
#pragma once

#include "base/result.h"

#include <stdbool.h>

#define PASSWORD_LEAST 10    // characters
#define PASSWORD_MOST 1024   // bytes; none is ever cut
#define PASSWORD_ENCODED 128 // with salt and cost, as argon2 writes it

// RESULT_INVALID: too short, too long, or no UTF-8.
enum result password_check(const char *password, struct error *err);

// With a random salt: the same password gives another text each time.
void password_encode(const char *password, char out_encoded[PASSWORD_ENCODED]);

// encoded NULL (no such account): false, after the same time as for any other.
bool password_is(const char *encoded, const char *password);
