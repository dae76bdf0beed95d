// Which instruments cut, and when a move of one is long enough to be a job. For session.c only.
#pragma once

#include "step/output.h"
#include "step/scene_parts.h"

// One instrument and one tissue: since when its blade moves without having cut.
struct sweep {
    bool active;
    pose T_mesh_tip;
    double opening;
    int64_t time_ns;
    vec3 last; // where the tip was at the last step
};

// The cuts that one undo takes back: those of one closing of a jaw, of one press of a burr's
// button, or of one pass of a blade.
//
// A stroke ends when the instrument or its handle is lost, the burr stops, or the jaw has opened by
// 0.2 from where it was closed farthest. A stroke of a burr or a blade also ends after 0.5 s
// without a cut: from the last cut that landed and changed the tissue to the next move that cuts.
struct stroke {
    uint32_t number;
    bool active;
    double closed; // a jaw's least opening in it
    int64_t cut_ns;
};

// The moves of one instrument in one tissue that wait for their job, in order of time: the path of
// the hand while another job is under way. If there is no room, two neighbours become one move.
#define CUTTING_WAITING_MAX 64

struct waiting_moves {
    int count;
    struct waiting_move {
        uint32_t stroke;
        int64_t begin_ns;
        struct blade_move move;
    } moves[CUTTING_WAITING_MAX];
};

// Before rule 2: the move that began first among those that are due, so that none waits for ever.
struct due_move {
    struct sweep *from; // NULL: none is due
    struct sweep to;
    int instrument, tissue;
};

struct cutting {
    struct sweep sweeps[INSTRUMENT_COUNT][TISSUES_MAX];
    struct stroke strokes[INSTRUMENT_COUNT];
    struct waiting_moves waiting[INSTRUMENT_COUNT][TISSUES_MAX]; // large: walked where some wait
    int waiting_count;                                           // moves in all of them
    uint32_t stroke_count;                 // ever begun, so that no two have one number
    int rules;                             // as in session_settings
    const struct instruments *instruments; // of the session
    struct due_move due;                   // of the step that was watched last
};

// Ends all sweeps. Waiting moves stay.
void cutting_rest(struct cutting *cutting);

// Drops the waiting moves, and returns their number.
int cutting_drop_waiting(struct cutting *cutting);

// Whether a move of this stroke, or of an older one, waits.
bool cutting_waits(const struct cutting *cutting, uint32_t stroke);

// Ends all strokes: later cuts begin new ones.
void cutting_end_strokes(struct cutting *cutting);

// A cut of that stroke changed the tissue.
void cutting_landed(struct cutting *cutting, uint32_t stroke, int64_t time_ns);

// Looks at all instruments of a step. A move that is due begins to wait, and a new sweep begins.
// Before rule 2 no move waits: a move that is due grows until it is taken. Returns the number of
// moves that had no room and are not cut.
int cutting_watch(struct cutting *cutting, const struct scene *scene,
                  const struct session_output *out);

// True if moves wait: *out_job gets those that waited longest, successive moves of one instrument,
// tissue and stroke.
bool cutting_take(struct cutting *cutting, struct job *out_job);
