// Reads what comes from outside, or computes, in a process of its own: a fault there, or a file
// that asks for all memory, ends that process and nothing else.
//
// The program starts itself again with a hidden command. That command calls confine_self before it
// opens a file, and answers on its standard output alone.
#pragma once

#include "base/result.h"

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

struct confine_limits {
    int memory_mb; // of address space, the program's own included
    int cpu_s;
    const atomic_bool *cancelled; // once true, confine_run ends the process; NULL: nothing does
};

// From here on this process gets no more memory and processor time than this. It opens files only
// to read them, and no sockets. It starts no program and no process. Only the standard streams stay
// open. It ends with the process that started it. Ends the process if it cannot be confined, or if
// its standard output is a file, where no answer can go; if the kernel has no seccomp, it says so
// and goes on without that part. Under a sanitizer, which needs
// more of both, only the processor time is limited.
void confine_self(const struct confine_limits *limits);

// The command's answer, on its standard output: the result, then `payload`, or the error's text.
// Returns an exit code.
int confine_answer(enum result result, const struct error *err, const void *payload, size_t size);
// The same of several pieces, which together are the payload.
struct confine_piece {
    const void *bytes;
    size_t size;
};
int confine_answer_pieces(const struct confine_piece *pieces, int count);

// Starts this program with the arguments (the first is its name, the last NULL) and waits for its
// answer. After RESULT_OK the caller frees *out_payload, which has at most size_max bytes. A result
// of the command is returned as it is. RESULT_LIMIT: the command was ended, most likely by its
// limits; the error names them. RESULT_IO: it could not be started. Other threads may run
// meanwhile.
enum result confine_run(const char *const arguments[], const struct confine_limits *limits,
                        size_t size_max, uint8_t **out_payload, size_t *out_size,
                        struct error *err);
