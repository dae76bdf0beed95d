// A recorded session run again, to go on with it: the trace is the truth, and a session's state is
// what its inputs lead to.
#pragma once

#include "sessions/opening.h"

struct restored {
    struct trace_header header;
    struct trace_place place; // where it goes on
    enum session_state state;
    int scene;              // index of its case in the config; -1: this server has not got it
    struct metrics metrics; // of the steps recorded in this trace
    struct snapshot_maker snapshots;
    struct remarks remarks; // of this trace
    // Without serial, trace and row, its clock as it was; NULL: it does not go on.
    struct open_session *session;
};

// All of a trace, or what came before at_s seconds after its start and before it was stopped (NULL:
// all). Answers as trace_read at the end of what is run: RESULT_MISSING where more could follow,
// RESULT_CLOSED where the trace is closed, which goes on only if at_s is given; RESULT_REFUSED
// where the case or the version is not this server's, steps are missing, or a step does not
// reproduce its recorded hash; RESULT_INVALID where at_s is beyond its end; RESULT_TIMEOUT where
// the server ends. From any thread, while the server has its cases.
enum result restore_run(const struct sessions *sessions, const char *path, const double *at_s,
                        struct restored *out, struct error *err);

// Releases a session that nobody has taken (and set to NULL here).
void restore_fini(struct restored *restored);
