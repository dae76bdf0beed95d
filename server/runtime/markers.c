#include "runtime/markers.h"

#include "base/clock.h"
#include "runtime/attempts.h"
#include "runtime/stepping.h"

#include <string.h>

#define MARKERS_HZ 20
#define MARKERS_BURST 256
#define DONE "done" // the name of the marker of the pedal that ends a trainee's attempt
#define DONE_HELD_NS NS_PER_S
#define AHEAD_NS NS_PER_S // a time of the future that is no error of the clocks

void markers_join(struct station_runtime *station) {
    station->marking.holds = false;
}

void markers_begin(struct station_runtime *station) {
    struct marking *m = &station->marking;
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
           marker->time_ns <= step_now_ns(station) + AHEAD_NS;
}

// False where the trace has no room now.
static bool record(struct station_runtime *station, const struct marker *marker) {
    struct marking *m = &station->marking;
    if (!is_of_session(station, marker)) {
        atomic_fetch_add_explicit(&station->counts.markers_refused, 1, memory_order_relaxed);
        return true;
    }
    if (!trace_append_marker(station->session->trace, marker))
        return false;
    m->tells = true;
    m->recorded = (struct session_marker){station->session->serial, *marker};
    return true;
}

// False: the owner of the sessions has too much to do.
static bool tell(struct worker *worker, struct station_runtime *station) {
    struct marking *m = &station->marking;
    if (m->tells && !ring_push(station->marked, &m->recorded))
        return false;
    if (m->tells)
        worker->runtime->config.notify(worker->runtime->config.user);
    m->tells = false;
    return true;
}

static void hear_done(struct marking *m, const struct marker *marker) {
    if (!strcmp(marker->name, DONE))
        m->done_ns = marker->value != 0 ? clock_now_ns() : 0;
}

static void leave_if_held(struct worker *worker, struct station_runtime *station) {
    struct marking *m = &station->marking;
    if (!m->done_ns || clock_now_ns() - m->done_ns < DONE_HELD_NS)
        return;
    m->done_ns = 0;
    attempts_leave_practice(worker, station);
}

// False: it has to be held.
static bool take(struct station_runtime *station, const struct station_marker *next) {
    struct marking *m = &station->marking;
    struct marker marker = next->marker;
    if (next->joins != station->connection.joins || !station->connection.clock_known ||
        !station->session)
        return true; // the station sends it again
    if (!is_known(m, &marker)) {
        marker.time_ns += clock_bridge_now(&station->bridge, station->connection.clock_offset_ns) +
                          station->session->ahead_ns;
        if (!record(station, &marker))
            return false;
        hear_done(m, &marker);
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
    leave_if_held(worker, station);
    while (tell(worker, station) && next_one(station)) {
        if (!bucket_take(&m->rate, MARKERS_HZ, MARKERS_BURST, clock_now_ns()) ||
            !take(station, &m->held))
            return;
        m->holds = false;
    }
}
