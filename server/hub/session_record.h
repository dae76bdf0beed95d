// One session as the records (store) keep it.
#pragma once

#include "session/session.h"
#include "store/store.h"
#include "trace/trace.h"

#define SESSION_RESULTS_MAX (TISSUES_MAX * 16)

struct session_record {
    struct store_session session;
    struct store_result results[SESSION_RESULTS_MAX];
    int result_count;
};

// What is known when a session begins.
void session_record_begin(const struct trace_header *header, const char *trace,
                          struct session_record *out);

// What the resection of one tissue came to, docs/RECORDS.md names the metrics.
void session_record_figures(struct session_record *record, const char *group,
                            const struct tissue_figures *figures);

// Writes the trace's hash. False where the file cannot be read: errno says why.
bool session_record_hash(struct store_session *session);

// The names of a case's tissues, or NULL where it is not known any more.
typedef const struct scene *(*scene_finder)(void *user, uint64_t case_hash);

// All of a session whose server did not write its end, from the trace alone: up to its last whole
// record.
enum result session_record_from_trace(const char *trace, scene_finder find, void *user,
                                      struct session_record *out, struct error *err);
