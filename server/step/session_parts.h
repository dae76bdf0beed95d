// The members of struct session. For session.c and session_keep.c only.
#pragma once

#include "step/cutting.h"
#include "step/easing.h"
#include "step/loose.h"
#include "step/samples.h"
#include "step/session.h"

struct session {
    const struct scene *scene;
    struct session_settings settings;
    enum session_state state;
    uint64_t step;
    int64_t time_ns;
    int64_t travel_ns; // of the newest frame: no age of its samples
    uint64_t hash;
    struct samples samples;
    bool in_contact[INSTRUMENT_COUNT];
    struct avatar_memory memory[INSTRUMENT_COUNT];
    int portals[INSTRUMENT_COUNT]; // that each goes through: index in the case
    pose correction[BODY_COUNT];   // M of this step, in the mock-up's frame
    bool seen[INSTRUMENT_COUNT];   // at the step before, with its tip at `tips`
    pose tips[INSTRUMENT_COUNT];   // T_mockup_tip
    pose bodies[BODY_COUNT];       // T_mockup_body at the step before
    struct warp_surface surfaces[CASE_GROUPS_MAX];
    struct easing *easings[TISSUES_MAX]; // NULL where the tissue has no S'_max
    struct cutting cutting;
    struct loose *loose; // NULL: the case has none
    uint64_t last_job;
    enum job_kind job_out; // given to the caller, and not yet landed; JOB_NONE: no job is
    uint32_t stroke_out;   // that it is of
    bool to_restore[TISSUES_MAX];
    bool touched[TISSUES_MAX]; // by a job since it was last whole
    uint32_t to_undo;          // strokes
    uint32_t undo_behind;      // not before moves of this stroke and older ones are cut
    bool is_taken_over;        // it asks for no job (session_take_over)
    bool is_astray;            // a result was lost: the operation has cut what was not eased in
    bool loose_moves;          // a loose body did, in the last step
    struct loose_output lay[CASE_LOOSE_MAX]; // where they were then
};

// The warp reads what the tissue's easing has now.
void session_take_surface(struct session *session, int tissue);
