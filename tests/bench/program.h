// The programs that lie beside this one, as child processes.
#pragma once

#include "base/result.h"

#include <sys/types.h>

#define PROGRAM_ARGUMENTS 24

// `name` and its arguments, NULL-terminated. `log`: a file for what it says on stderr, NULL: ours.
// `cpu`: the only processor that it may use, -1: all.
struct program {
    const char *words[PROGRAM_ARGUMENTS];
    const char *log;
    int cpu;
};

// Starts it; the caller waits for *out_pid. out_fd: its stdout, which the caller closes; NULL:
// none. RESULT_MISSING where it was not built.
enum result program_start(const struct program *program, pid_t *out_pid, int *out_fd,
                          struct error *err);
