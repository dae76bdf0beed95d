// The programs that lie beside this one, or of the system, as child processes.
#pragma once

#include "base/result.h"

#include <stdbool.h>
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
// none. RESULT_MISSING where it was not built. A name with a / is the path of one of the system's.
enum result program_start(const struct program *program, pid_t *out_pid, int *out_fd,
                          struct error *err);
// Waits until its log has the text. RESULT_CLOSED: it ended before, and was waited for, or is not
// so far in a minute.
enum result program_wait(pid_t pid, const char *log, const char *text, struct error *err);
bool program_says(const char *log, const char *text);
void program_end(pid_t *pid, int signal_number); // and waits for it; 0: it does not run
int program_port(void);                          // a free one on the loopback address
