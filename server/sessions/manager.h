// The session manager: a thread that takes the runtime's notices, and a pool of threads that open
// and release sessions. So no file delays a notice or another station.
#pragma once

#include "sessions/parts.h"

void manager_create(struct sessions *sessions); // before any session; manager_notify may be called
void manager_start(struct sessions *sessions);  // from now on opens sessions that stations need
void manager_stop(struct sessions *sessions);   // from now on opens no session; NULL is fine
// After runtime_stop: releases the sessions that the runtime gave back.
void manager_destroy(struct sessions *sessions);

// Opens a session if the station needs one and has none. From any thread, never waits. Does nothing
// before manager_start, which looks at all stations.
void manager_open(struct sessions *sessions, int station);

// Looks at the station soon: it may need a session, or another one. From any thread, never waits.
void manager_call(struct sessions *sessions, int station);

// Runs `work` on a thread of the pool, behind what the station has there. From any thread, never
// waits. Not done where the server ends.
void manager_run(struct sessions *sessions, int station,
                 void (*work)(struct sessions *sessions, int station));

// Whether sessions may be opened and controlled: between manager_start and manager_stop.
bool manager_opens(const struct sessions *sessions);

// Wakes the manager: a notice or a marker has come. From any thread, never waits. sessions: struct
// sessions
void manager_notify(void *sessions);
