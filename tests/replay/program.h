// Programs that a test calls.
#pragma once

#include <stddef.h>

// Runs it through the shell and returns its exit code. `out` gets what it says, stderr too, as far
// as there is room, with a zero byte at the end.
int run_program(const char *program, const char *arguments, char *out, size_t size);
