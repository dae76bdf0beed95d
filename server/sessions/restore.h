// Runs a recorded session again, to go on with it. A session's state follows from its inputs, which
// the trace contains. Where its state was kept beside the trace, and is that of the trace, only the
// inputs behind it are run. A later part of a session's trace (trace/part.h) begins with a state of
// the server before.
#pragma once

#include "sessions/opening.h"
#include "sessions/sharing.h"
#include "task/attempt_keep.h"

struct restored {
    struct trace_header header;
    struct trace_place place; // the end of the part that was run
    uint64_t kept_step;       // the last one that needed not be run; 0: all were
    enum session_state state;
    struct job asked; // what the session waits for; id 0: nothing
    struct lasting_records lasting;
    int scene;              // index of its case in the config; -1: not a case of this server
    struct metrics metrics; // of the steps recorded in this trace
    struct snapshot_maker snapshots;
    struct remarks remarks;          // of this trace
    struct marker_list markers;      // too
    struct marker marked;            // the last of them; number 0: none
    uint32_t attempts;               // how many began
    uint32_t attempt_lost;           // number of one that runs and cannot be judged here; 0: none
    struct kept_attempt kept;        // of the state with which the trace begins; else 0
    struct session_attempt *attempt; // whose end it does not have; NULL: none
    struct session_attempt *ended;   // all others, the last first: the records may lack them
    // Still without serial, trace and row, and on its old clock. NULL: it cannot go on.
    struct open_session *session;
};

// Runs a whole trace (at_s NULL), or its first *at_s seconds without a stop. RESULT_MISSING: the
// trace is open, and the session can go on. RESULT_CLOSED: the trace is closed; the session goes on
// only if at_s is given. RESULT_REFUSED: the case or the version is not this server's, steps are
// missing, a step does not reproduce its recorded hash, or a job of the server before lands
// otherwise here; or at_s is of a later part. RESULT_VERSION: that begins with a state of another
// KEPT_FORMAT. RESULT_IO: the trace or its case cannot be read. RESULT_INVALID: at_s is after the
// end. RESULT_TIMEOUT: the server is ending. Other results as trace_read. From any thread, while
// the server has its cases.
enum result restore_run(const struct sessions *sessions, const char *path, const double *at_s,
                        struct restored *out, struct error *err);

// Releases the session and its attempt, unless the caller took it and set `session` to NULL.
void restore_fini(struct restored *restored);
