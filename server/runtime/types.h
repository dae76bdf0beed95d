// Types of the runtime's interface: configuration, sessions, counts, notices.
#pragma once

#include "base/latency.h"
#include "metrics/metrics.h"
#include "net/control.h"
#include "runtime/devices.h"
#include "runtime/slowed.h"
#include "runtime/step_snapshot.h"
#include "task/attempt.h"
#include "task/shared_site.h"
#include "trace/trace.h"

#include <stdatomic.h>

#define STATIONS_MAX 4096 // of a server
#define STATION_NAME_MAX 64

struct runtime_station {
    const char *name;      // for the log
    bool start_by_command; // else a session runs as soon as a worker has it
    // Buttons of each instrument's handle that are down while its tip touches; 0: none.
    uint32_t contact_buttons[INSTRUMENT_COUNT];
};

struct runtime_config {
    const char *address;   // of the datagram sockets; empty for all
    int udp_port;          // worker i listens on udp_port + i; 0: any free port
    int workers;           // at least 1
    int wait_s;            // how long a session waits for its station
    int64_t hold_ns;       // how long a sample is valid: what a late frame told too
    double touch_reach_mm; // a tip in contact counts as no farther off the surface than this
    int station_count;
    const struct runtime_station *stations;
    // Until when this server may serve unasked: monotonic, moved on by the owner of the lease. Then
    // only fresh frames make steps, and commands are refused. NULL: for ever.
    const atomic_int_fast64_t *serve_until_ns;
    // Where messages to stations go out: set before a station joins or a session is attached.
    struct control *const *control;
    // Called after each notice, from a worker's or cut worker's thread; must not wait.
    void (*notify)(void *user);
    bool keep_at_once; // each session's state is kept at its first step that can be, too
    // Or NULL: a state of the session with this trace is on disk; by the keeper's thread, perhaps
    // after the session has ended.
    void (*kept)(void *user, const char *trace);
    void *user;
};

// The metrics of a session so far.
struct live_metrics {
    uint64_t session; // its serial; 0: none yet
    const struct scene *scene;
    struct metrics metrics;
};

// An attempt at a task. The owner of the sessions makes it, for one session. From the request on it
// belongs to the session's worker, until NOTICE_ATTEMPT gives it back, or NOTICE_ENDED with the
// session.
struct session_attempt {
    uint64_t session; // serial
    enum attempt_purpose purpose;
    enum attempt_hand hand;
    int mark_version; // of the pass mark; 0: the task's own
    double pass_time_s;
    int pass_errors;
    struct shared_site *site;
    struct session_attempt *next; // for its owner
    // The worker's:
    uint32_t number;  // in the session, from 1; 0: it was not begun
    int64_t begun_ns; // since the session's start
    struct attempt attempt;
};

// The last attempt of a session, as it was last told.
struct live_attempt {
    uint64_t session;           // serial; 0: there was no session yet
    uint32_t news;              // counts up with each
    arthron_AttemptState state; // number 0: the session has none yet
};

#define TRACE_FILE_MAX 256

// A session with its trace. The owner of the sessions fills it in, and releases it after
// NOTICE_ENDED. In between, session and trace belong to one worker, and the operation to that
// worker's cut worker.
struct session_runtime {
    uint64_t serial; // no two sessions of a server's life have the same
    struct session *session;
    struct trace_writer *trace;
    struct operation *operation;
    const struct scene *scene;
    struct live_metrics metrics;
    struct snapshot_maker snapshots;
    // Of a resumed session: its last state and time, how far its clock is ahead of the new
    // server's, and the result of a job that had not landed, or NULL.
    enum session_state state;
    int64_t last_ns, ahead_ns;
    struct job_result *pending;
    struct marker marked;            // too: the last marker of its trace; number 0: none
    uint32_t attempts;               // that its trace has
    uint32_t attempt_lost;           // number of one that runs there and cannot go on; 0: none
    struct session_attempt *attempt; // NULL: none runs
    char trace_file[TRACE_FILE_MAX]; // beside which its state is kept; empty: it is not
};

struct session_marker {
    uint64_t session; // serial
    struct marker marker;
};

enum frame_fate {
    FATE_TAKEN, // it made a step
    FATE_LOST,
    FATE_LATE,
    FATE_OLD,
    FATE_EARLY,
    FATE_INVALID,
    FATE_EXCESS,
    FATE_COUNT
};

// Numbers that a station's worker publishes for any thread.
struct station_counts {
    atomic_uint_fast64_t fates[FATE_COUNT]; // of frames since the server's start
    atomic_uint_fast64_t steps;
    atomic_uint_fast64_t frames_lost;  // numbers that never came
    atomic_uint_fast64_t frames_late;  // behind a newer one: what they alone told was used
    atomic_uint_fast64_t frames_old;   // came before, or too late: dropped
    atomic_uint_fast64_t frames_early; // before the clock offset or the session was known: dropped
    atomic_uint_fast64_t frames_invalid; // values out of range: dropped
    atomic_uint_fast64_t frames_excess;  // beyond the station's share of its worker: dropped
    atomic_uint_fast64_t touches;        // of this session
    atomic_int_fast64_t drift_nm;        // of the instrument that is farthest off
    atomic_uint_fast64_t trace_missing;  // as of trace_status
    atomic_bool trace_failing;
    atomic_uint_fast64_t clock_steps;            // of the station's clock
    atomic_int_fast64_t clock_step_ns;           // the last one
    atomic_int_fast64_t clock_stepped_ns;        // when
    atomic_int_fast64_t slowed_ns[SLOWED_COUNT]; // when it last was; 0: never
    atomic_int_fast64_t datagram_ns;             // when the newest frame came by datagram
    atomic_int_fast64_t frame_ns; // when any came, or the session or connection began
    atomic_int_fast64_t pause_ns; // the longest between two frames since runtime_take_pause_ns
    atomic_uint_fast64_t markers_refused; // not of the session's time, or its trace has none
    struct device_counts devices[WIRE_DEVICES_MAX];
    atomic_int_fast64_t warp_nm; // the largest at any tip since the last runtime_take_warp_mm
};

// Datagrams that the workers' sockets dropped.
struct socket_counts {
    uint64_t strangers, forged, replayed, malformed, too_long;
};

// What all workers have done since the server's start, and what waits for them now.
struct runtime_figures {
    struct latency_figures steps;   // the kernel's part
    struct latency_figures answers; // from a frame's receipt until its answer was made
    struct latency_figures cuts;    // a job of a cut, beside the steps
    uint64_t cuts_asked, cuts_landed[JOB_OUTCOME_COUNT];
    size_t requests_waiting, notices_waiting, jobs_waiting, mesh_requests_waiting;
};

// A session's tissues after their last jobs.
struct tissue_report {
    uint64_t session; // serial; 0: none yet
    struct tissue_figures figures[TISSUES_MAX];
    uint64_t mesh_hashes[TISSUES_MAX]; // as stations follow the meshes
};

enum session_end {
    END_CLOSED,
    END_DESERTED,   // its station stayed away for too long
    END_HANDED_OVER // it is open: another server goes on with it
};

enum notice_kind {
    NOTICE_STATE,   // a session's state changed
    NOTICE_TAKEN,   // a request was taken
    NOTICE_UNDONE,  // a job of an undo has landed, or a reset has made the undo void
    NOTICE_ATTEMPT, // an attempt has ended, or was not begun: it belongs to its owner again
    NOTICE_OPENED,  // runtime_tissues reports on the session
    NOTICE_ENDED    // the session belongs to its owner again
};

// From the runtime to the owner of its sessions.
struct runtime_notice {
    enum notice_kind kind;
    int station;
    uint64_t session;         // serial
    enum session_state state; // after it
    uint64_t ticket;          // NOTICE_TAKEN, NOTICE_UNDONE: the request's
    bool done;                // NOTICE_TAKEN: false where it was refused, or there was no room
    struct {                  // NOTICE_UNDONE
        enum job_outcome outcome;
        uint32_t cuts;
        double volume_mm3;
        bool more; // another job of the same undo follows
    } undone;
    struct session_attempt *attempt; // NOTICE_ATTEMPT
    struct session_runtime *ended;   // NOTICE_ENDED
    enum session_end end;            // NOTICE_ENDED
};
