// Passwords that a config names by their files.
#pragma once

#include "base/result.h"

// The first line, without its end; what is longer than `size` is cut off. of: whose password it is,
// for the error. RESULT_MISSING: the file cannot be read, or is empty.
enum result password_file_read(const char *path, const char *of, char *out, size_t size,
                               struct error *err);
