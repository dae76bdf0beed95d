// Resumes sessions that were open when the server was killed. A session's state follows from its
// inputs, so the server runs each session again from its trace, many times as fast as it was. The
// session then goes on in the same trace. Only the newest session of a station is resumed. The
// traces of older ones get an end record.
//
// Call these in order while the server starts:
#pragma once

#include "sessions/parts.h"

// Before anybody can connect: runs the sessions again and claims their slots.
void resume_replay(struct sessions *sessions);
// Before the records are opened: locks and opens the traces of resumed sessions, ends the others.
void resume_open_traces(struct sessions *sessions);
// Gives the sessions to their workers and to the records.
void resume_attach(struct sessions *sessions);
// Instead, if the server cannot start.
void resume_release(struct sessions *sessions);
