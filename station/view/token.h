// The secret that a viewer must know: 256 random bits as 64 hexadecimal digits, in a file that only
// the station's user can read.
#pragma once

#include "base/result.h"

#define TOKEN_LENGTH 64

// Reads it, or makes it where there is no such file. RESULT_FORMAT: the file holds something else.
enum result token_get(const char *path, char out_token[TOKEN_LENGTH + 1], struct error *err);

// RESULT_INVALID: others than its owner can read or write the file. Fine where there is none yet.
enum result token_check(const char *path, struct error *err);
