// The life of a server's sessions: cases are loaded, stations come and go, sessions are opened,
// controlled, ended, resumed and copied. Owns the runtime, the control connections and the console.
//
// Threads beside the runtime's: one for control connections, one for the console, the session
// manager (manager.h) with a few that open and close files, and the recorder, who alone waits for
// the database.
#pragma once

#include "runtime/runtime.h"
#include "sessions/config.h"
#include "sessions/station_slot.h"

struct sessions;

// Loads all cases, resumes sessions, opens all sockets, starts all threads. The config is copied.
// *cancelled: may become true at any time and ends the start early with RESULT_TIMEOUT; it must
// outlive the sessions. The error names the case, key file, address or folder at fault.
enum result sessions_create(const struct sessions_config *config, const atomic_bool *cancelled,
                            struct sessions **out_sessions, struct error *err);

// A copy or an undo that somebody waits for is broken off and answered, so that who must end before
// the sessions does not wait for it. From any thread.
void sessions_break_off(struct sessions *sessions);

// Tells the stations, ends every session with a whole trace, joins all threads.
void sessions_destroy(struct sessions **sessions);
// The same, but the sessions stay open: the next server goes on with them (resume.h).
void sessions_hand_over(struct sessions **sessions);

// ---- from any thread but a worker's; `sessions` is a struct sessions

void sessions_command(void *sessions, const char *actor, const arthron_Command *command,
                      arthron_CommandReply *out_reply);
// Of the session that the station has, or had last. False where there is no such station.
bool sessions_metrics(void *sessions, const char *station, arthron_Metrics *out_metrics);

void sessions_status(struct sessions *sessions, int station, struct station_status *out_status);
void sessions_info(struct sessions *sessions, int station, arthron_SessionInfo *out_info);
// The remarks of the station's session with that serial that a page has not as they are now.
// told: the revision up to which it has all, and told_each[number - 1] the revision that it has of
// each. At most `room` of them; true where these are all, up to *out_revision.
bool sessions_remarks(struct sessions *sessions, int station, uint64_t session, uint64_t told,
                      const uint64_t told_each[REMARKS_MAX], struct kept_remark *out, int room,
                      int *out_count, uint64_t *out_revision);

const struct sessions_config *sessions_config(const struct sessions *sessions);
const struct scene *sessions_scene(const struct sessions *sessions, int index); // of a case
struct runtime *sessions_runtime(struct sessions *sessions);
