// What is kept of a session beside its trace (trace/state.h), or given to another server: all but
// its remarks and markers, which the trace tells by itself, and of its attempts the one that runs.
#pragma once

#include "runtime/types.h"
#include "task/attempt_keep.h"
#include "trace/state.h"

#define KEPT_SESSION_MAX                                                                           \
    (SESSION_KEPT_MAX + sizeof(struct kept_attempt) + sizeof(struct metrics) +                     \
     sizeof(struct snapshot_maker) + 64)

// The worker's part, behind a step: copies KEPT_SESSION_MAX bytes at most. asked: the job of the
// step's output, which does not run yet.
void kept_session_write(const struct session_runtime *session, const struct job *asked,
                        struct kept *kept);

// Puts both parts together; `state` gets the content.
void kept_session_join(const struct kept *session, const struct kept *operation,
                       struct trace_state *state);

struct kept_session {
    struct session *session;
    struct operation *operation;
    struct job asked; // by its last step, and not run; id 0: none
    struct kept_attempt attempt;
    struct metrics metrics;
    struct snapshot_maker snapshots;
};

// header: of the trace. RESULT_VERSION: it is of another KEPT_FORMAT. RESULT_FORMAT: the content is
// not that of such a session on this scene, or of another step. The caller destroys session and
// operation.
enum result kept_session_read(const struct trace_state *state, const struct scene *scene,
                              const struct trace_header *header, struct kept_session *out,
                              struct error *err);

// Its attempts alone. RESULT_VERSION, RESULT_FORMAT.
enum result kept_session_attempt(const struct trace_state *state, struct kept_attempt *out,
                                 struct error *err);
