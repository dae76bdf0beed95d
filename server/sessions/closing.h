// Closes and signs the traces of sessions that a killed server left open and that are not resumed.
// A remark in the trace gives the reason. The records then get the session's results.
//
// It leaves open what a later start may still resume: the newest trace of a configured station,
// within `wait_s`. It cannot close a damaged trace, or one of a version that the server no longer
// writes.
#pragma once

#include "sessions/parts.h"

// Starts a thread of low priority that goes through the folder of traces. Call it once, after
// resume_attach.
void closing_start(struct sessions *sessions);
// Waits for the thread. A large trace is left to the next start. Call it before a session is handed
// over: an open trace would be closed. Does nothing if the thread was not started.
void closing_stop(struct sessions *sessions);

// Closes one trace at once, unless it is closed or cannot be. why: the reason.
void closing_close(struct sessions *sessions, const char *path, const char *why);
