// Whether several traces are the parts of one session.
#pragma once

#include "trace/trace.h"

// In any order. RESULT_OK: they are all parts of one session from the first on, with tokens that
// rise; each later part begins with a state of which the part before has the step, with the hash of
// its output and the trace's hash behind it; and no job that was taken over landed otherwise there.
// A state may also be that with which the part before began itself. Records are read as far as they
// are whole: whether all are, the reader tells.
//
// RESULT_REFUSED: they are not, and the error names the part. Else as trace_reader_create.
enum result trace_parts_check(const char *const *paths, int count, struct error *err);
