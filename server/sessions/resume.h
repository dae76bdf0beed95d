// Sessions that were open when the server was killed. The trace is the truth: a session's state is
// what its inputs lead to, so it is run again from them, many times faster than it was, and goes on
// in the same trace. Only the newest session of a station goes on; older ones had ended, and those
// traces get the end that they lack.
//
// While the server starts, one after the other:
#pragma once

#include "sessions/parts.h"

// Before anybody can connect: runs the sessions again and claims their slots.
void resume_replay(struct sessions *sessions);
// Before the records are opened: locks and opens the traces that go on, ends the others.
void resume_open_traces(struct sessions *sessions);
// The sessions go to their workers and into the records.
void resume_attach(struct sessions *sessions);
// Where the server does not get so far.
void resume_release(struct sessions *sessions);
