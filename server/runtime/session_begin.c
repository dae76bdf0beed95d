#include "runtime/session_begin.h"

#include "base/check.h"
#include "runtime/attempts.h"
#include "runtime/capture.h"
#include "runtime/cut_worker.h"
#include "runtime/frames.h"
#include "runtime/markers.h"
#include "runtime/stepping.h"

#include <string.h>

static void clear_counts(struct station_runtime *station) {
    struct station_counts *counts = &station->counts;
    atomic_store(&counts->frames_lost, 0);
    atomic_store(&counts->frames_late, 0);
    atomic_store(&counts->frames_old, 0);
    atomic_store(&counts->frames_early, 0);
    atomic_store(&counts->frames_invalid, 0);
    atomic_store(&counts->frames_excess, 0);
    for (int i = 0; i < SLOWED_COUNT; i++)
        atomic_store(&counts->slowed_ns[i], 0);
    memset(station->drift, 0, sizeof station->drift);
    atomic_store(&counts->touches, 0);
    atomic_store(&counts->drift_nm, 0);
    atomic_store(&counts->markers_refused, 0);
}

void session_begin(struct worker *worker, struct station_runtime *station,
                   struct session_runtime *session) {
    CHECK(!station->session);
    station->session = session;
    station->state = session->state;
    cut_worker_open(worker->cut_worker, station->index, session);
    clear_counts(station);
    memset(&station->undo, 0, sizeof station->undo);
    station->job = 0;
    station->ending = false;
    frame_order_end(&station->order);
    memset(&station->late, 0, sizeof station->late);
    memset(&station->bridge, 0, sizeof station->bridge);
    memset(&station->share, 0, sizeof station->share);
    memset(station->slowed_told_ns, 0, sizeof station->slowed_told_ns);
    station->events = 0;
    markers_begin(station);
    capture_begin(worker, station);
    attempts_begin(worker, station);
    station->last_step_ns = session->last_ns;
    newest_put(station->metrics, &session->metrics);
    station->metrics_ns = session->last_ns;
    frames_begin_pause(station);
    if (session->pending)
        step_land_pending(worker, station);
    step_without_frame(worker, station, INPUT_EMPTY);
    // A resumed session that had not started yet still has to start.
    if (session->state == SESSION_WAITING && !station->config->start_by_command)
        step_without_frame(worker, station, INPUT_START);
    else
        step_announce(worker, station);
}
