// A session that begins where a recorded one was at some time: a trace of its own, in which the
// other's inputs until then come first, and the state that they led to.
#pragma once

#include "sessions/parts.h"

struct fork;

// from: the path of a trace, or the id of a session whose trace lies with this server's. at_s:
// since its start; later inputs, and its stop, are left out. Runs the session again on a thread of
// low priority, and waits for that and for the disk: without any lock. RESULT_MISSING, RESULT_IO,
// RESULT_FORMAT, or as restore_run.
enum result fork_create(struct sessions *sessions, int station, const char *from, double at_s,
                        struct fork **out_fork, struct error *err);

// It takes the place of the station's session. The command lock of the slot is held. False: the
// reply says why not.
bool fork_begin(struct fork *fork, arthron_CommandReply *reply);

// What has not begun leaves nothing behind. NULL inside is fine.
void fork_destroy(struct fork **fork);

// Removes what a server that was killed left of copies that had not begun.
void fork_clear(const char *traces_dir);
