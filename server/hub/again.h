// A recorded session run again, to go on with it: the trace is the truth, and a session's state is
// what its inputs lead to.
#pragma once

#include "hub/seat.h"

struct again {
    struct trace_header header;
    struct trace_place place; // where it goes on
    enum session_state state;
    int scene;              // index into hub.scenes; -1: this server has not its case
    struct metrics metrics; // of the steps recorded in this trace
    struct moments moments;
    struct remarks remarks; // of this trace
    struct live
        *live; // without serial, trace and row, its clock as it was; NULL: it does not go on
};

// All of a trace, or what came before at_s seconds after its start and before it was stopped (NULL:
// all). Answers as trace_read at the end of what is run: RESULT_MISSING where more could follow,
// RESULT_CLOSED where the trace is closed, and then goes on only if at_s is given; RESULT_REFUSED
// where the case or the version is not this server's, steps are missing, or one comes out otherwise
// than it was; RESULT_TIMEOUT after hub_break_off. From any thread, while the hub has its scenes.
enum result again_run(const struct hub *hub, const char *path, const double *at_s,
                      struct again *out, struct error *err);

// With a live that nobody has taken (and set to NULL here): it does not go on after all.
void again_fini(struct again *again);
