// One session as the records (store) keep it.
#pragma once

#include "step/session.h"
#include "store/store.h"
#include "trace/trace.h"

// The row of a session that begins.
void session_row_begin(const struct trace_header *header, const char *trace,
                       struct store_session *out);

// The scene of a case, for the names of its groups, or NULL if the server no longer has the case.
typedef const struct scene *(*scene_finder)(void *user, uint64_t case_hash);

struct session_score {
    struct store_session session;
    struct store_result *results;
    int count, room;
    int attempts; // that its trace has with their ends
};

// Everything about a session that has ended, from its trace: header, steps, metrics
// (docs/METRICS.md) and the file's hash. A trace that ends early is of an interrupted session, and
// counts up to its last whole record. Only a trace with a signature of the authority (a PEM file)
// has results and attempts, because anybody could have written another one. Reads the whole file: as long as the
// disk needs, and some 2 us a step.
enum result session_score_trace(const char *trace, const char *authority, scene_finder find,
                                void *user, struct session_score *out, struct error *err);
void session_score_fini(struct session_score *score);
