// One slot for each station of the config: whether it is connected, and its session's id and state.
// The slot is the only place for these.
//
//     EMPTY ── claim ──> OPENING ── attached ──> ATTACHED ── ending ──> ENDING
//       ^                   │ failed                │ closed               │ closed
//       └───────────────────┴───────────────────────┴──────────────────────┘
// A stop that the worker does not take leads from ENDING back to ATTACHED.
//
// The thread that claims the slot opens the session. The claim makes the session's id, so a station
// that connects meanwhile gets the id of the session to come.
//
// All functions may be called from any thread but a worker's, and take the slot's lock, which is
// held for copies only.
#pragma once

#include "net/control.h"
#include "sessions/config.h"
#include "sessions/marker_list.h"
#include "sessions/remarks.h"

#include <pthread.h>

#define STATION_REFUSED_MAX 160

enum station_phase { SLOT_EMPTY, SLOT_OPENING, SLOT_ATTACHED, SLOT_ENDING };

// The properties of a session that never change.
struct session_about {
    uint64_t serial; // of its struct session_runtime; 0: there was no session yet
    uint8_t id[16];
    char trainee[STATION_NAME_MAX];
    int scene; // index of its case in the config
    int64_t start_utc_ns;
    int64_t start_ns; // on its own clock
    double strength;  // of its warp
    struct instruments instruments;
    char trace[SESSIONS_PATH_MAX];
};

struct station_status {
    enum station_phase phase;
    uint8_t session_id[16];     // EMPTY: of the last session
    enum session_state state;   // WAITING until it is attached, CLOSED if the slot is empty
    struct session_about about; // of the last session that was attached
    bool has_tissues;           // runtime_tissues reports on that session
    uint64_t tissues_of;        // serial of the last session with a report of runtime_tissues
    uint64_t help_of;           // serial of the session whose trainee calls an instructor; 0: none

    // The sessions to come:
    int scene;
    double strength; // NaN: the config's
    char trainee[STATION_NAME_MAX];
    bool stopped;     // by command: no session until a start, a case or a restart of the station
    int64_t retry_ns; // no session before this: the last attempt to open one failed
    char refused[STATION_REFUSED_MAX]; // why the last attempt failed; empty: it did not
    int64_t refused_ns;                // when

    // The station:
    bool connected;
    struct control_peer peer;
    uint64_t connection; // Hello.connection: tells a reconnect from a rival
    bool calibrated;
    arthron_Calibration calibration; // from Hello
    struct instruments instruments;  // from Hello; of a station that never came: the usual ones
    int device_count;
    arthron_Device devices[WIRE_DEVICES_MAX];
    int64_t rtt_ns, clock_uncertainty_ns;
};

// The outcome of an undo.
struct undo_answer {
    enum job_outcome outcome;
    uint32_t cuts;
    double volume_mm3;
};

struct station_slot {
    // One command at a time. A thread may hold it while it waits, or uses files of this station. No
    // worker, control thread or web thread takes it.
    pthread_mutex_t command_lock;

    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct station_status status;
    struct remarks remarks;     // of the last session
    struct marker_list markers; // too
    uint64_t ticket, taken;     // the last ticket, the last one that the worker answered
    bool taken_done;
    uint64_t ended; // serial of the last session that its cut worker gave back
    struct {
        bool awaited;     // a thread waits for the answer
        bool pending;     // the worker has not answered
        uint64_t session; // serial of the session to undo in
        uint64_t ticket;  // of the request, which the answer names
        struct undo_answer undone;
    } undo;
    bool broken_off; // all waits end
};

void station_slot_init(struct station_slot *slot, int scene, const char *trainee);
void station_slot_fini(struct station_slot *slot);

void station_slot_status(struct station_slot *slot, struct station_status *out_status);

// ---- the session ----

// EMPTY → OPENING. False in another phase. id: the session's; NULL: a new one.
bool station_slot_claim(struct station_slot *slot, const uint8_t id[16]);
// The same, where a connected station has no session and none was stopped by command.
bool station_slot_claim_needed(struct station_slot *slot, int64_t now_ns);
// OPENING → ATTACHED. said, marked: NULL, or remarks and markers of an earlier server, which are
// moved to the slot.
// give: hands the session to its worker. It runs under the lock, so that no request reaches the
// worker before the session; it must not wait.
void station_slot_attached(struct station_slot *slot, const struct session_about *about,
                           enum session_state state, struct remarks *said,
                           struct marker_list *marked, void (*give)(void *user), void *user);
// OPENING → EMPTY.
void station_slot_failed(struct station_slot *slot, int64_t retry_ns);
// The station, or a session of it, was refused; why: for a person.
void station_slot_refused(struct station_slot *slot, const char *why);
// ATTACHED → ENDING: a command stops the session.
void station_slot_ending(struct station_slot *slot);
// ENDING → ATTACHED: the worker did not stop it. False if the session has ended nevertheless.
bool station_slot_goes_on(struct station_slot *slot);
// The worker's state. CLOSED: ATTACHED or ENDING → EMPTY. Ignored for any other session.
void station_slot_set_state(struct station_slot *slot, uint64_t session, enum session_state state);
// Ignored for any other session.
void station_slot_put_marker(struct station_slot *slot, uint64_t session,
                             const struct marker *marker);
void station_slot_set_tissues(struct station_slot *slot, uint64_t session);

// ---- the sessions to come ----

void station_slot_set_stopped(struct station_slot *slot, bool stopped);
// Also ends a stop by command.
void station_slot_set_case(struct station_slot *slot, int scene, double strength);
void station_slot_set_trainee(struct station_slot *slot, const char *trainee);
// session: the serial of the one whose trainee calls an instructor; 0: none does.
void station_slot_set_help(struct station_slot *slot, uint64_t session);

// ---- the station ----

// False if the station is connected from elsewhere. *out_status: after the join. A stop by command
// lasts over a reconnect, but not over a restart of the station's program.
bool station_slot_join(struct station_slot *slot, struct control_peer peer,
                       const arthron_Hello *hello, struct station_status *out_status);
bool station_slot_is_of(struct station_slot *slot, struct control_peer peer);
void station_slot_leave(struct station_slot *slot);
void station_slot_set_clock(struct station_slot *slot, int64_t rtt_ns, int64_t uncertainty_ns);

// ---- waiting, on the monotonic clock ----
//
// False if the time is over or station_slot_break_off was called.

// Until a session is attached or the slot is empty.
bool station_slot_wait_open(struct station_slot *slot, int64_t until_ns);
// Until runtime_tissues reports on the last session, or the session has ended.
bool station_slot_wait_tissues(struct station_slot *slot, int64_t until_ns);
// Until runtime_tissues reports on all jobs of this session, which has been stopped.
bool station_slot_wait_ended(struct station_slot *slot, uint64_t session, int64_t until_ns);
void station_slot_set_ended(struct station_slot *slot, uint64_t session);

// A number for a request to the worker. station_slot_set_taken answers it. One at a time, under the
// command lock.
uint64_t station_slot_new_ticket(struct station_slot *slot);
void station_slot_set_taken(struct station_slot *slot, uint64_t ticket, bool done);
bool station_slot_wait_taken(struct station_slot *slot, uint64_t ticket, int64_t until_ns,
                             bool *out_done);

// Gives the request a ticket. False if an undo is under way.
bool station_slot_begin_undo(struct station_slot *slot, uint64_t *out_ticket);
// The worker's answer to the request with that ticket; other requests ignore it. more: another
// answer follows.
void station_slot_add_undone(struct station_slot *slot, uint64_t ticket,
                             const struct undo_answer *undone, bool more);
// The worker did not take the request in time, or refused it: a later answer is dropped.
void station_slot_cancel_undo(struct station_slot *slot);
// Waits for the answer and ends the undo. False if none came: the time is over, the session has
// ended, or the wait was broken off.
bool station_slot_end_undo(struct station_slot *slot, int64_t until_ns,
                           struct undo_answer *out_undone);

void station_slot_break_off(struct station_slot *slot);
