// A step as pages show it (arthron_Moment in the schema). The worker makes one at each step, and so
// does a playback of a recorded session. Nothing here allocates or reads a clock.
#pragma once

#include "metrics/metrics.h"
#include "step/session.h"
#include "wire/wire.h"

struct snapshot_instrument {
    bool seen;              // at this step or before; else all below is 0
    enum validity validity; // lost: the poses as when it was last seen; a session that is closed:
                            // all as before
    pose tip, warped;       // T_mockup_tip, as measured and as shown
    double nearest_mm;      // -1: none
    double penetration_mm, warp_mm, gain, gain_least;
    double speed_mm_s; // of the measured tip
    struct handle handle;
    bool has_force; // it is known at this step
    double force_n;
};

struct step_snapshot {
    uint64_t session; // the session's serial; 0: none yet
    uint64_t step;
    int64_t time_ns;  // on the session's clock
    int64_t since_ns; // the session's start
    enum session_state state;
    enum validity joint_validity;
    struct joint_angles joint;
    pose T_mockup_body[BODY_COUNT];
    pose T_mockup_virtual[BODY_COUNT];
    uint32_t events[EVENT_COUNT]; // how often each came since the start
    struct snapshot_instrument instruments[INSTRUMENT_COUNT];
    int loose_count; // loose bodies of the case
    struct loose_output loose[CASE_LOOSE_MAX];
    uint32_t attempt;   // the number of the last one; 0: there was none
    int64_t attempt_ns; // that it has taken
};

// One session's, from step to step.
struct snapshot_maker {
    struct step_snapshot now;
    int64_t start_ns;                  // of the session, on its own clock
    vec3 velocities[INSTRUMENT_COUNT]; // of the measured tips, mm/s
    int64_t stepped_ns;                // of the step before; 0: none
};

void snapshot_begin(struct snapshot_maker *maker, uint64_t session, int64_t start_ns);

// Keeps a maker, or reads one that snapshot_begin has made for the same session.
void snapshot_keep(struct snapshot_maker *maker, struct kept *kept);

// Makes maker->now from the next step. The velocity of a tip follows the measured motion with a
// time constant of 50 ms, so that a tracker's noise does not add up to speed:
//     v += (dt / (50 ms + dt)) (dx/dt − v)
void snapshot_step(struct snapshot_maker *maker, const struct session_output *output);

// Puts the forces of this step into maker->now; metrics: behind this step.
void snapshot_forces(struct snapshot_maker *maker, const struct metrics *metrics);

void snapshot_to_wire(const struct step_snapshot *snapshot, uint32_t station,
                      arthron_Moment *out_message);

// The time between two moments at the rate that the page asked for.
int64_t snapshot_period_ns(const arthron_Watch *watch);
