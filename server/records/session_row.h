// One session as the records (store) keep it.
#pragma once

#include "step/session.h"
#include "store/store.h"
#include "trace/trace.h"

// What is known when a session begins.
void session_row_begin(const struct trace_header *header, const char *trace,
                       struct store_session *out);

// The names of a case's groups, or NULL where the case is not known any more.
typedef const struct scene *(*scene_finder)(void *user, uint64_t case_hash);

struct session_score {
    struct store_session session;
    struct store_result *results;
    int count, room;
};

// All of a session that has ended, from its trace alone: what its header says, up to which step it
// went, its metrics (docs/METRICS.md), and the file's hash. A
// trace that ends early is of a session that was interrupted, and counts up to its last whole
// record. A trace that the authority (a PEM file) does not vouch for, by a signature at its end,
// has no results: anybody could have written it. It reads the whole file: as long as the disk needs
// for that, and some 2 us a step.
enum result session_score_trace(const char *trace, const char *authority, scene_finder find,
                                void *user, struct session_score *out, struct error *err);
void session_score_fini(struct session_score *score);
