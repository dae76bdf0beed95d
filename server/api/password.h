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

// With a random salt: the same password gives another text each time. RESULT_LIMIT: there is no
// memory for it now.
enum result password_encode(const char *password, char out_encoded[PASSWORD_ENCODED],
                            struct error *err);

// encoded NULL (no such account): not right, after the same time as for any other. RESULT_LIMIT:
// there is no memory to find out now.
enum result password_is(const char *encoded, const char *password, bool *out_right,
                        struct error *err);
