// The state of a session in a file beside its trace (NAME.trace.state), so that a server that
// starts need not run all of the trace again. The trace stays the truth: a state counts only where
// its place in the trace, the hash there and the program that wrote it are right.
//
// The file: a magic and the format of what is kept; the identity of the program, of the C library
// and of the processor; the place and the hash of the output there; the content; the SHA-256 of all
// that.
//
// The same bytes begin a later part of a session's trace (trace/part.h). Another program may have
// written those, if its format is the same.
#pragma once

#include "trace/trace.h"

// Raise it with any change of what is kept, or of its meaning: of session, operation, metrics,
// snapshot or attempt.
#define KEPT_FORMAT 2

#define TRACE_STATE_MAX ((size_t)1 << 30)

struct trace_state {
    uint32_t format;          // KEPT_FORMAT of the program that wrote it; set by the writer
    bool is_own;              // this very program wrote it, on such a machine; set by the reader
    struct trace_place place; // behind a recorded step
    uint64_t output_hash;     // of that step
    size_t size;
    uint8_t *content; // the caller's to free
};

#define TRACE_STATE_PATH_MAX 288
void trace_state_path(const char *trace, char out_path[TRACE_STATE_PATH_MAX]);

// Takes the place's hash from the trace. The file that was there before is replaced as a whole, and
// on disk when this returns. RESULT_MISSING: the trace is not yet so long; nothing is written then.
// RESULT_REFUSED: no such step ends at the place. RESULT_IO: a file cannot be read or written.
enum result trace_state_write(const char *trace, struct trace_state *state, struct error *err);

// RESULT_MISSING: there is none. RESULT_REFUSED: another program wrote it, or on another machine.
// RESULT_CORRUPT: it is not whole. RESULT_IO: it cannot be read. Whether the trace has the place
// trace_reader_skim tells.
enum result trace_state_read(const char *trace, struct trace_state *out_state, struct error *err);

void trace_state_remove(const char *trace);

// ---- as bytes

// The bytes of the whole file, for other servers. The caller frees them. RESULT_MISSING,
// RESULT_IO.
enum result trace_state_load(const char *trace, uint8_t **out_bytes, size_t *out_size,
                             struct error *err);

// Reads bytes from anywhere. The state's content points into them, and only programs of its format
// can use that. RESULT_CORRUPT: it is no whole state.
enum result trace_state_parse(const uint8_t *bytes, size_t size, struct trace_state *out_state,
                              struct error *err);
