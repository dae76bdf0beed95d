#include "runtime/markers.h"

#include "base/clock.h"
#include "runtime/attempts.h"
#include "runtime/stepping.h"

#include <string.h>

#define MARKERS_HZ 20
#define MARKERS_BURST 256
#define DONE_HELD_NS NS_PER_S
#define DONE_FRESH_NS (NS_PER_S / 2) // a press that comes later has waited, and its release may too
#define MARKER_AHEAD_NS NS_PER_S     // a time of the future that is no error of the clocks

void markers_join(struct station_runtime *station) {
    station->marking.holds = false;
    station->marking.done.is_down = false; // its release may be lost
}

void markers_begin(struct station_runtime *station) {
    struct marking *m = &station->marking;
    m->done.is_down = false;
    const struct marker *last = &station->session->marked;
    if (!m->run && last->number) {
        m->run = last->run;
        m->number = last->number;
    }
    m->position = trace_position(station->session->trace);
}

// ---- acknowledging ------------------------------------------------------------------------------

// A session that has ended has put its trace on disk, or has logged that it could not.
static void acknowledge(struct worker *worker, struct station_runtime *station) {
    struct marking *m = &station->marking;
    arthron_Control message = {.which_message = arthron_Control_marker_ack_tag};
    if (!m->owes || !station->connection.connected)
        return;
    if (station->session && !trace_is_on_disk(station->session->trace, m->position))
        return;
    message.message.marker_ack.number = m->number;
    m->owes = !control_send(*worker->runtime->config.control, station->connection.peer, &message);
}

// ---- taking -------------------------------------------------------------------------------------

static bool is_known(const struct marking *m, const struct marker *marker) {
    return marker->run == m->run && marker->number <= m->number;
}

// What was pressed before the session began is none of it.
static bool is_of_session(const struct station_runtime *station, const struct marker *marker) {
    return trace_takes_markers(station->session->trace) &&
           marker->time_ns >= station->session->snapshots.start_ns &&
           marker->time_ns <= step_now_ns(station) + MARKER_AHEAD_NS;
}

// What waited somewhere tells how long the pedal was held once it is released.
static void hear_done(struct worker *worker, struct station_runtime *station,
                      const struct marker *marker) {
    struct press *done = &station->marking.done;
    if (strcmp(marker->name, MARKER_DONE) != 0)
        return;
    if (done->is_down && marker->value == 0 && marker->time_ns - done->time_ns >= DONE_HELD_NS)
        attempts_leave_practice(worker, station);
    *done = (struct press){.is_down = marker->value != 0,
                           .is_fresh = step_now_ns(station) - marker->time_ns < DONE_FRESH_NS,
                           .time_ns = marker->time_ns};
}

static void leave_if_held(struct worker *worker, struct station_runtime *station) {
    struct press *done = &station->marking.done;
    if (done->is_down && done->is_fresh && station->session && station->connection.connected &&
        step_now_ns(station) - done->time_ns >= DONE_HELD_NS)
        done->is_down = !attempts_leave_practice(worker, station);
}

// False where the trace has no room now.
static bool record(struct worker *worker, struct station_runtime *station,
                   const struct marker *marker) {
    struct marking *m = &station->marking;
    if (!is_of_session(station, marker)) {
        atomic_fetch_add_explicit(&station->counts.markers_refused, 1, memory_order_relaxed);
        return true;
    }
    if (!trace_append_marker(station->session->trace, marker))
        return false;
    m->tells = true;
    m->recorded = (struct session_marker){station->session->serial, *marker};
    hear_done(worker, station, marker);
    return true;
}

// False: the owner of the sessions has too much to do.
static bool tell_marker(struct worker *worker, struct station_runtime *station) {
    struct marking *m = &station->marking;
    if (m->tells && !ring_push(station->marked, &m->recorded))
        return false;
    if (m->tells)
        worker->runtime->config.notify(worker->runtime->config.user);
    m->tells = false;
    return true;
}

// False: it has to be held.
static bool take(struct worker *worker, struct station_runtime *station,
                 const struct station_marker *next) {
    struct marking *m = &station->marking;
    struct marker marker = next->marker;
    if (next->joins != station->connection.joins || !station->connection.clock_known ||
        !station->session)
        return true; // the station sends it again
    if (!is_known(m, &marker)) {
        marker.time_ns += clock_bridge_now(&station->bridge, station->connection.clock_offset_ns) +
                          station->session->ahead_ns;
        if (!record(worker, station, &marker))
            return false;
        m->run = marker.run;
        m->number = marker.number;
        m->position = trace_position(station->session->trace);
    }
    m->owes = true;
    return true;
}

static bool next_one(struct station_runtime *station) {
    struct marking *m = &station->marking;
    if (!m->holds)
        m->holds = ring_pop(station->markers, &m->held);
    return m->holds;
}

void markers_take(struct worker *worker, struct station_runtime *station) {
    struct marking *m = &station->marking;
    acknowledge(worker, station);
    while (tell_marker(worker, station) && next_one(station)) {
        if (!bucket_take(&m->rate, MARKERS_HZ, MARKERS_BURST, clock_now_ns()) ||
            !take(worker, station, &m->held))
            return;
        m->holds = false;
    }
    if (!m->holds)
        leave_if_held(worker, station);
}
