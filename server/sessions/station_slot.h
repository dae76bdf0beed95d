// One slot for each station of the config: whether it is connected, and its session's id and state.
// The slot is the only place for these.
//
//     EMPTY ── claim ──> OPENING ── attached ──> ATTACHED ── ending ──> ENDING
//       ^                   │ failed                │ closed               │ closed
//       └───────────────────┴───────────────────────┴──────────────────────┘
// A stop that the worker does not take leads from ENDING back to ATTACHED.
//
// Whoever claims the slot opens the session. The claim makes the session's id, so that a station
// that connects meanwhile is told the id that the session gets.
//
// All functions may be called from any thread but a worker's, and take the slot's lock, which is
// held for copies only.
#pragma once

#include "net/control.h"
#include "sessions/config.h"
#include "sessions/remarks.h"

#include <pthread.h>

enum station_phase { SLOT_EMPTY, SLOT_OPENING, SLOT_ATTACHED, SLOT_ENDING };

// What stays the same in a session.
struct session_about {
    uint64_t serial; // of its struct session_runtime; 0: there was no session yet
    uint8_t id[16];
    char trainee[STATION_NAME_MAX];
    int scene; // index of its case in the config
    int64_t start_utc_ns;
    int64_t start_ns; // on its own clock
    double strength;  // of its warp
    char trace[SESSIONS_PATH_MAX];
};

struct station_status {
    enum station_phase phase;
    uint8_t session_id[16];     // EMPTY: of the last session
    enum session_state state;   // WAITING until it is attached, CLOSED where the slot is empty
    struct session_about about; // of the last session that was attached
    bool has_tissues;           // what the runtime tells of tissues is of that session
    uint64_t tissues_of;        // serial of the last session whose tissues the runtime can tell

    // The sessions to come:
    int scene;
    double strength; // NaN: the config's
    char trainee[STATION_NAME_MAX];
    bool stopped;     // by command: no session until a start, a case or another run of the station
    int64_t retry_ns; // not before: the last attempt to open one failed

    // The station:
    bool connected;
    struct control_peer peer;
    uint64_t connection; // Hello.connection: tells a reconnect from a rival
    bool calibrated;
    arthron_Calibration calibration; // as Hello told it
    int device_count;
    arthron_Device devices[WIRE_DEVICES_MAX];
    int64_t rtt_ns, clock_uncertainty_ns;
};

// How an undo came out.
struct undo_answer {
    enum job_outcome outcome;
    uint32_t cuts;
    double volume_mm3;
};

struct station_slot {
    // One command at a time. Held over waits and files of this station; no worker, and no thread of
    // connections or pages, takes it.
    pthread_mutex_t command_lock;

    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct station_status status;
    struct remarks remarks; // of the last session
    uint64_t ticket, taken; // the last one given, the last one that the worker answered
    bool taken_done;
    struct {
        bool awaited;     // somebody waits for the answer
        bool pending;     // the worker has not answered
        uint64_t session; // that was asked
        struct undo_answer undone;
    } undo;
    bool broken_off; // nobody waits any more
};

void station_slot_init(struct station_slot *slot, int scene, const char *trainee);
void station_slot_fini(struct station_slot *slot);

void station_slot_status(struct station_slot *slot, struct station_status *out_status);

// ---- the session ----

// EMPTY → OPENING. False in another phase. id: the session's; NULL: a new one.
bool station_slot_claim(struct station_slot *slot, const uint8_t id[16]);
// The same, where a connected station has no session and none was stopped by command.
bool station_slot_claim_needed(struct station_slot *slot, int64_t now_ns);
// OPENING → ATTACHED. said: remarks of an earlier server, taken over, or NULL. give: hands the
// session to its worker, under the lock, so that no request to the session goes ahead of it; it
// must not wait.
void station_slot_attached(struct station_slot *slot, const struct session_about *about,
                           enum session_state state, struct remarks *said, void (*give)(void *user),
                           void *user);
// OPENING → EMPTY.
void station_slot_failed(struct station_slot *slot, int64_t retry_ns);
// ATTACHED → ENDING: a command stops the session.
void station_slot_ending(struct station_slot *slot);
// ENDING → ATTACHED: the worker did not stop it. False where the session has ended all the same.
bool station_slot_goes_on(struct station_slot *slot);
// The worker says so. CLOSED: ATTACHED or ENDING → EMPTY. Not of this session: no change.
void station_slot_set_state(struct station_slot *slot, uint64_t session, enum session_state state);
void station_slot_set_tissues(struct station_slot *slot, uint64_t session);

// ---- the sessions to come ----

void station_slot_set_stopped(struct station_slot *slot, bool stopped);
// It also ends a stop by command.
void station_slot_set_case(struct station_slot *slot, int scene, double strength);
void station_slot_set_trainee(struct station_slot *slot, const char *trainee);

// ---- the station ----

// False where the station is connected from another place. *out_status: after it. A station that
// comes again keeps what a command stopped; another run of its program does not.
bool station_slot_join(struct station_slot *slot, struct control_peer peer,
                       const arthron_Hello *hello, struct station_status *out_status);
void station_slot_leave(struct station_slot *slot);
void station_slot_set_clock(struct station_slot *slot, int64_t rtt_ns, int64_t uncertainty_ns);

// ---- waiting, on the monotonic clock; false where the time is over, or station_slot_break_off was
// called

// Until a session is attached or the slot is empty.
bool station_slot_wait_open(struct station_slot *slot, int64_t until_ns);
// Until the last session's tissues can be told, or it has ended.
bool station_slot_wait_tissues(struct station_slot *slot, int64_t until_ns);

// A number for a request to the worker, which station_slot_set_taken answers; one at a time, under
// the command lock.
uint64_t station_slot_new_ticket(struct station_slot *slot);
void station_slot_set_taken(struct station_slot *slot, uint64_t ticket, bool done);
bool station_slot_wait_taken(struct station_slot *slot, uint64_t ticket, int64_t until_ns,
                             bool *out_done);

// False where an undo is on its way.
bool station_slot_begin_undo(struct station_slot *slot);
// The worker's answer; more: another follows.
void station_slot_add_undone(struct station_slot *slot, uint64_t session,
                             const struct undo_answer *undone, bool more);
// The session was reset: an undo that was asked for will not come.
void station_slot_cancel_undo(struct station_slot *slot);
// Waits and ends the undo. False where no answer came: time, the session's end, or a break-off.
bool station_slot_end_undo(struct station_slot *slot, int64_t until_ns,
                           struct undo_answer *out_undone);

void station_slot_break_off(struct station_slot *slot);
