// Copies a recorded session up to some time into a new session, which goes on from there. The new
// session's trace begins with the inputs of the recorded one.
#pragma once

#include "sessions/parts.h"

struct fork;

// from: the path of a trace, or the id of a session with a trace in this server's folder. at_s:
// time since the session's start; later inputs and the stop are left out. Runs the session again on
// a thread of low priority and waits for it and for the disk, without holding a lock.
// RESULT_MISSING, RESULT_IO, RESULT_FORMAT, or as restore_run.
enum result fork_create(struct sessions *sessions, int station, const char *from, double at_s,
                        struct fork **out_fork, struct error *err);

// Replaces the station's session by the copy. The caller holds the slot's command lock. False: the
// reply says why not.
bool fork_begin(struct fork *fork, arthron_CommandReply *reply);

// Also removes the files of a copy that has not begun. NULL inside is fine.
void fork_destroy(struct fork **fork);

// Removes the files of copies that had not begun when an earlier server was killed.
void fork_clear(const char *traces_dir);
