// The state of workers and their stations, and the channels between threads. Private to this room.
#pragma once

#include "base/newest.h"
#include "base/ring.h"
#include "net/control.h"
#include "net/datagram.h"
#include "runtime/clock_bridge.h"
#include "runtime/drift.h"
#include "runtime/fair_share.h"
#include "runtime/frame_order.h"
#include "runtime/keeping.h"
#include "runtime/late_frames.h"
#include "runtime/progress.h"
#include "runtime/real_time.h"
#include "runtime/types.h"

#include <pthread.h>

// The newest state of a station's connection, from the control thread.
struct station_connection {
    uint64_t joins; // counts up with each
    bool connected;
    bool confirms_in_replies; // it sends back the challenges that come in replies
    struct control_peer peer;
    bool clock_known;
    int64_t clock_offset_ns; // server = station + offset
    uint64_t confirms;       // counts up with each
    uint64_t challenge;      // of the last
};

// Times on the station's clock, but for received_ns.
struct tcp_frame {
    uint64_t joins; // of the connection that it came over
    int64_t received_ns;
    struct frame frame;
};

// Time on the station's clock.
struct station_marker {
    uint64_t joins; // of the connection that it came over
    struct marker marker;
};

// The markers of a station. The worker's alone.
// Of a pedal, on the session's clock.
struct press {
    bool is_down, is_fresh;
    int64_t time_ns;
};

struct marking {
    struct bucket rate;
    bool holds; // `held` could not be taken yet
    struct station_marker held;
    uint64_t run, number; // the last one that was taken
    uint64_t position;    // behind it in the session's trace
    bool tells;           // `recorded` is still to be told
    struct session_marker recorded;
    bool owes;         // its acknowledgement
    struct press done; // of the pedal that ends an attempt
};

struct station_runtime {
    int index;
    const struct runtime_station *config;
    struct station_counts counts;

    atomic_bool called;             // it is in its worker's ring of those
    struct newest *connections;     // of struct station_connection, from the control thread
    struct station_connection told; // the control thread's
    struct ring *frames;            // of struct tcp_frame, from the control thread
    struct ring *markers;           // of struct station_marker, from the control thread
    struct ring *marked;            // of struct session_marker, for the owner of the sessions

    pthread_mutex_t shown_lock; // of the readers; the worker takes no part
    struct newest *snapshots;   // of struct step_snapshot, from the worker
    struct step_snapshot snapshot;
    struct newest *metrics; // of struct live_metrics, from the worker
    struct live_metrics last_metrics;
    struct newest *attempts; // of struct live_attempt, from the worker
    struct live_attempt last_attempt;

    pthread_mutex_t tissues_lock; // for copies only; the worker takes no part
    struct tissue_report tissues; // from the cut worker

    atomic_uint_fast64_t job;        // on its way, set by the worker; 0: none
    struct job job_given;            // the same; the cut worker reads it
    atomic_uint_fast64_t kept_bytes; // of its session's last state, set by the cut worker

    // The worker's alone:
    struct session_runtime *session; // NULL: none
    enum session_state state;
    bool ending; // once the job that is on its way has landed
    bool is_due; // among worker->due
    struct station_connection connection;
    uint32_t udp_connection;
    struct frame_order order;
    struct late_frames late;
    struct clock_bridge bridge;
    struct marking marking;
    struct live_attempt attempt_shown;
    struct fair_share share;
    int64_t slowed_told_ns[SLOWED_COUNT]; // when it was told; 0: never
    arthron_Reply reply;                  // to the newest frame
    uint64_t copied;                      // the number of the last frame that was answered twice
    uint32_t events;                      // of all steps since
    uint32_t event_counts[EVENT_COUNT];   // of each bit, since the connection began
    uint32_t frames_lost, frames_late;    // since then
    int64_t last_step_ns, last_frame_ns;
    int64_t metrics_ns; // of the session's clock, when metrics were last published
    struct {
        bool asked;
        uint64_t ticket; // of the request
        uint64_t job;    // the last that the session asked for to do it; 0: none yet
    } undo;              // that is on its way: one at a time
    struct device_watch device_watch;
    struct drift drift[INSTRUMENT_COUNT];
    struct keeping keeping;
};

enum request_kind {
    REQUEST_ATTACH,
    REQUEST_KEEP,
    REQUEST_HAND_OVER,
    REQUEST_INPUT,
    REQUEST_REMARK,
    REQUEST_ATTEMPT,
    REQUEST_LEAVE
};

// From the owner of the sessions to a worker.
struct worker_request {
    enum request_kind kind;
    int station;
    uint64_t ticket; // all but REQUEST_ATTACH to REQUEST_HAND_OVER
    union {
        struct session_runtime *session; // REQUEST_ATTACH
        enum input_kind input;           // REQUEST_INPUT
        struct session_attempt *attempt; // REQUEST_ATTEMPT
        bool by_trainee;                 // REQUEST_LEAVE
        struct {                         // REQUEST_REMARK
            uint64_t of_session;
            struct remark remark;
        };
    };
};

struct cut_worker;
struct looks;
struct keeper;
struct session_image;

struct worker {
    struct runtime *runtime;
    int index;
    pthread_t thread;
    struct cut_worker *cut_worker;
    struct session_image *image; // of the session whose state is being kept
    struct datagram_endpoint *endpoint;
    int wake_fd;
    struct progress progress;
    struct real_time real_time;
    pthread_mutex_t request_lock; // of the producers; the worker takes no part
    struct ring *requests;        // of struct worker_request
    struct ring *notices;         // of struct runtime_notice
    struct ring *called;          // of int: stations for which the control thread left something
    struct looks *looks;          // the worker's
    int *due, due_count;          // too: places that are looked at in this pass
    struct {
        atomic_uint_fast64_t strangers, forged, replayed, malformed, too_long;
    } counts;
    struct latency steps, answers, cuts; // as of runtime_figures; cuts: by the cut worker
    atomic_uint_fast64_t cuts_asked, cuts_landed[JOB_OUTCOME_COUNT];
};

struct runtime {
    struct runtime_config config;
    struct station_runtime *stations;
    struct worker *workers;
    int worker_count;
    struct watchdog *watchdog;
    struct keeper *keeper;
    bool hand_over; // before stop is set
    atomic_bool stop;
};

static inline struct worker *station_worker(struct runtime *runtime, int station) {
    return &runtime->workers[station % runtime->worker_count];
}

// Of the worker's own stations: how many there are, and the place of one among them.
static inline int worker_stations(const struct runtime *runtime, int worker) {
    int count = runtime->config.station_count, workers = runtime->worker_count;
    return count > worker ? (count - worker - 1) / workers + 1 : 0;
}

static inline int worker_place(const struct runtime *runtime, int station) {
    return station / runtime->worker_count;
}

static inline int worker_station(const struct worker *worker, int place) {
    return place * worker->runtime->worker_count + worker->index;
}

// The capacity of a ring with so much for each of the worker's stations, and at least so much.
size_t worker_room(const struct runtime *runtime, int worker, size_t each, size_t least);

// Counts frames for the session and for good.
static inline void count_frames(struct station_counts *counts, atomic_uint_fast64_t *of_session,
                                enum frame_fate fate, uint64_t by) {
    atomic_fetch_add_explicit(of_session, by, memory_order_relaxed);
    atomic_fetch_add_explicit(&counts->fates[fate], by, memory_order_relaxed);
}

// Wakes a thread that polls an eventfd.
void wake_fd(int fd);

// Whether it may serve unasked. A process that was stopped may go on behind that time.
bool worker_may_serve(const struct worker *worker);

// The worker's thread: for the owner of the sessions.
void worker_notify(struct worker *worker, const struct runtime_notice *notice);
