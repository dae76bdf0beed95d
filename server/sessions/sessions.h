// The life of a server's sessions: cases are loaded, stations come and go, sessions are opened,
// controlled, ended, resumed and copied. Owns the runtime, the control connections and the console.
//
// Threads beside the runtime's: one for control connections, one for the console, the session
// manager (manager.h), a few that open and close files, and the recorder. Only the recorder waits
// for the database, and a command that begins an attempt, for the pass mark.
#pragma once

#include "records/retention.h"
#include "runtime/runtime.h"
#include "sessions/config.h"
#include "sessions/station_slot.h"
#include "task/library.h"

struct sessions;

// Loads all cases, resumes sessions, opens all sockets, starts all threads. The config and its
// stations are copied. *cancelled: may become true at any time and ends the start early with
// RESULT_TIMEOUT; it must outlive the sessions. The error names the case, key file, address or
// folder at fault.
enum result sessions_create(const struct sessions_config *config, const atomic_bool *cancelled,
                            struct sessions **out_sessions, struct error *err);

// Ends every wait for a copy or an undo, with an answer. So threads that must end before
// sessions_destroy do not wait for these. From any thread.
void sessions_break_off(struct sessions *sessions);

// Tells the stations, ends every session with a whole trace, joins all threads.
void sessions_destroy(struct sessions **sessions);
// The same, but the sessions stay open: the next server goes on with them (resume.h).
void sessions_hand_over(struct sessions **sessions);

// ---- from any thread but a worker's; `sessions` is a struct sessions

void sessions_command(void *sessions, const char *actor, const arthron_Command *command,
                      arthron_CommandReply *out_reply);
// False if that is not the session that the station has, or had last. session: its serial.
bool sessions_metrics_of(struct sessions *sessions, int station, uint64_t session,
                         arthron_Metrics *out_metrics);
// Of the station's present or last session. False: there is no such station.
bool sessions_metrics(void *sessions, const char *station, arthron_Metrics *out_metrics);

void sessions_status(struct sessions *sessions, int station, struct station_status *out_status);
void sessions_info(struct sessions *sessions, int station, arthron_SessionInfo *out_info);
// The remarks that a page lacks or has in an old revision, of the station's session with this
// serial. told: the page has all remarks up to this revision. told_each[number - 1]: the page's
// revision of each remark. Gives at most `room` of them. True if no more are left, up to
// *out_revision.
bool sessions_remarks(struct sessions *sessions, int station, uint64_t session, uint64_t told,
                      const uint64_t told_each[REMARKS_MAX], struct kept_remark *out, int room,
                      int *out_count, uint64_t *out_revision);

// The markers of the station's session with this serial that a page lacks, at most `room`; *told
// counts those that it was given.
int sessions_markers(struct sessions *sessions, int station, uint64_t session, uint64_t *told,
                     struct marker *out, int room);

// Of several servers the others, and who serves which station (cluster/cluster.h).
int sessions_whose(const struct sessions *sessions, struct cluster_peer *out, int max,
                   int *out_served_by);

struct sessions_figures {
    struct control_counts control;
    int64_t control_round_ns; // as of control_round_ns
    int records_waiting;      // rows and entries that the recorder has still to write
    struct retention_figures retention;
    bool are_ending;
};
void sessions_figures(const struct sessions *sessions, struct sessions_figures *out_figures);

const struct sessions_config *sessions_config(const struct sessions *sessions);
const struct scene *sessions_scene(const struct sessions *sessions, int index); // of a case
// Whether a case could not be read at the start, and why: "case NAME: ...".
bool sessions_case_is_broken(const struct sessions *sessions, int index, struct error *out_why);
const struct task_library *sessions_tasks(const struct sessions *sessions); // as read at its start
struct runtime *sessions_runtime(struct sessions *sessions);
struct cluster *sessions_cluster(const struct sessions *sessions); // NULL: this server is alone
