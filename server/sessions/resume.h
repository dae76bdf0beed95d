// Resumes sessions that were open when the server was killed. A session's state follows from its
// inputs, so the server runs each session again from its trace, many times as fast as it was. The
// session then goes on in the same trace. Only the newest session of a station is resumed
// (closing.h: the others).
//
// Call these in order while the server starts:
#pragma once

#include "sessions/parts.h"

// Before anybody can connect: runs the sessions again and claims their slots. A session whose files
// cannot be read is named in the log and stays open, for the next start. RESULT_IO: the folder of
// traces cannot be read.
enum result resume_replay(struct sessions *sessions, struct error *err);
// Before the records are opened: locks and opens the traces of resumed sessions, closes those that
// cannot go on.
void resume_open_traces(struct sessions *sessions);
// Gives the sessions to their workers and to the records.
void resume_attach(struct sessions *sessions);
// Instead, if the server cannot start.
void resume_release(struct sessions *sessions);

// The same for one trace while the server runs: of a station that is connected nowhere, and has no
// session here. RESULT_REFUSED: it does not go on, and the log says why.
enum result resume_here(struct sessions *sessions, int station, const char *path,
                        struct error *err);

// The path of the station's newest trace; empty if there is none. RESULT_IO: the folder cannot be
// read.
enum result resume_newest(const struct sessions *sessions, const char *station,
                          char out_path[SESSIONS_PATH_MAX], struct error *err);
// Whether somebody wrote to a trace within the time that a session waits for its station, as far as
// the system tells.
bool resume_is_recent(const struct sessions *sessions, const char *path);
// The file that stands beside a trace while the server runs it again. If a start finds one, the
// program did not survive that.
void resume_marker(const char *trace, char out_path[SESSIONS_PATH_MAX + 16]);
