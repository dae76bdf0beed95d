// The output of a step.
#pragma once

#include "base/instrument.h"
#include "case/case.h"
#include "step/discrepancy.h"
#include "step/job.h"
#include "warp/adaptive.h"
#include "warp/avatar.h"
#include "warp/warp.h"

enum session_state {
    SESSION_WAITING,
    SESSION_RUNNING,
    SESSION_PAUSED,
    SESSION_CLOSED,
    SESSION_STATE_COUNT
};

const char *session_state_name(enum session_state state);

struct instrument_output {
    bool present;           // a pose was known at this step; else all below is 0
    enum validity validity; // of that pose
    pose T_mockup_tip;      // as measured
    pose T_mockup_warped;   // as to be shown
    struct warp warp;       // the space warp at the tip, in the mock-up's frame
    struct avatar_extrapolation
        extrapolation;     // how T_mockup_warped goes on, in the mock-up's frame
    double penetration_mm; // of the body, and
    double tip_gap_mm;     // of its tip: warp/avatar.h
    struct discrepancy discrepancy;
    struct handle handle;          // the last known; 0 where the instrument never had one
    enum validity handle_validity; // lost where it has none
};

// Values are in traces: append only.
enum loose_state { LOOSE_LYING, LOOSE_HELD, LOOSE_OUT, LOOSE_STATE_COUNT };

const char *loose_state_name(enum loose_state state); // "lying", "held", "out"

// Of a loose body's carrier: "femur", "probe", ...
const char *output_carrier_name(int carrier);

// A loose body of the case. Out of the knee it is where it left it.
struct loose_output {
    enum loose_state state;
    int carrier;         // the body that it lies on, or BODY_COUNT + the instrument that holds it
    pose T_mockup_loose; // as to be shown: the ellipsoid's axes
};

enum event {
    EVENT_STATE = 1 << 0,       // the session's state changed
    EVENT_DEVICE_LOST = 1 << 1, // a sample went from ok or held to lost
    EVENT_DEVICE_BACK = 1 << 2,
    EVENT_CONTACT = 1 << 3,  // an instrument came within 0.2 mm of a surface
    EVENT_RELEASE = 1 << 4,  // and left it by more than 0.4 mm
    EVENT_CUT = 1 << 5,      // a cut changed the tissue: it has landed
    EVENT_PIECE = 1 << 6,    // and a piece came off
    EVENT_REFUSED = 1 << 7,  // a cut was refused
    EVENT_UNDONE = 1 << 8,   // a stroke was undone: its tissue is as it was before, this has landed
    EVENT_GRASPED = 1 << 9,  // a jaw closed on a loose body
    EVENT_DROPPED = 1 << 10, // it opened, or lost it, inside the knee
    EVENT_TAKEN_OUT = 1 << 11 // a loose body left through a portal
};

#define EVENT_COUNT 12

const char *event_name(int bit); // 0 "state", 1 "device_lost", ...

// A job's outcome as it takes effect.
struct landed {
    uint64_t job; // 0: nothing landed at this step
    enum job_outcome outcome;
    int tissue;
    struct tissue_figures figures;
    uint64_t hash;       // of the result's meshes and blends
    uint64_t touch_hash; // of its offsets
};

struct session_output {
    uint64_t step;         // counts up from 1
    uint64_t frame_number; // of the input, 0 where it was no frame
    int64_t time_ns;
    enum session_state state;
    uint32_t events; // enum event, or-ed
    struct joint_angles joint;
    enum validity joint_validity;
    pose T_mockup_body[BODY_COUNT];
    // Where the virtual bones are: the tibia elsewhere where its ligaments are torn.
    pose T_mockup_virtual[BODY_COUNT];
    // Of the case's torn ligaments: how far each is put to the test, and what is given of its extra
    // motion (warp/adaptive.h).
    int torn_count;
    double opening[ADAPTIVE_LIGAMENTS_MAX], share[ADAPTIVE_LIGAMENTS_MAX];
    int described; // instruments of the session, beside the usual ones
    struct instrument_output instruments[INSTRUMENT_COUNT]; // [channel - CHANNEL_FIRST_INSTRUMENT]
    int loose_count;                                        // of the case
    struct loose_output loose[CASE_LOOSE_MAX];
    struct job job;       // to be run; id 0: none. At most one is on its way at any time
    struct landed landed; // at this step
    uint64_t hash;        // of all above and of the hash of the step before
};
