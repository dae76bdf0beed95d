// What a state's content holds, each part behind its size, so that a reader takes the ones that it
// knows: the session and its operation in this room, others in rooms above.
#pragma once

#include "base/kept.h"
#include "trace/state.h"

enum state_section {
    STATE_ATTEMPT, // task/attempt_keep.h
    STATE_METRICS,
    STATE_SESSION,
    STATE_SNAPSHOT,
    STATE_OPERATION,
    STATE_SECTION_COUNT
};

// Writers write the sections in this order. Returns where the section begins, to end it with.
size_t state_section_begin(struct kept *kept);
void state_section_end(struct kept *kept, size_t begin);

// To read a section; bad where the content has none, or is of another KEPT_FORMAT.
struct kept state_section(const struct trace_state *state, enum state_section section);

// The session and its operation; asked: the job of its last step, which did not run yet. The
// caller destroys both. RESULT_VERSION: it is of another KEPT_FORMAT. RESULT_FORMAT: it is not of
// such a session on this scene, or of another step.
enum result state_session_read(const struct trace_state *state, const struct scene *scene,
                               const struct session_settings *settings,
                               struct session **out_session, struct operation **out_operation,
                               struct job *out_asked, struct error *err);
