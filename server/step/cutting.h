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

// What one undo takes back: an instrument's cuts of one closing of the jaw, of one press of the
// shaver's button, of one pass of the knife.
//
// A stroke goes on until the instrument rests: it is gone, its handle is lost, the burr stands, or
// the jaw has opened by 0.2 from where it was closed farthest. A burr or a knife also ends it by
// 0.5 s without a cut, from the last that landed and changed the tissue to the move that is cut.
struct stroke {
    uint32_t number;
    bool active;
    double closed; // the jaw's least opening in it
    int64_t cut_ns;
};

// The moves of one instrument in one tissue that wait for their job, in the order of time: the way
// that the hand went while a job was under way. Where there is no room, two neighbours become one
// move.
#define CUTTING_WAITING_MAX 64

struct waiting_moves {
    int count;
    struct waiting_move {
        uint32_t stroke;
        int64_t begin_ns;
        struct blade_move move;
    } moves[CUTTING_WAITING_MAX];
};

// Before rule 2: of the moves that are due the one that began first, so that none waits for ever.
struct due_move {
    struct sweep *from; // NULL: none is due
    struct sweep to;
    enum blade_kind kind;
    int instrument, tissue;
};

struct cutting {
    struct sweep sweeps[INSTRUMENT_COUNT][TISSUES_MAX];
    struct stroke strokes[INSTRUMENT_COUNT];
    struct waiting_moves waiting[INSTRUMENT_COUNT][TISSUES_MAX];
    uint32_t stroke_count; // ever begun, so that no two have one number
    int rules;             // as in session_settings
    struct due_move due;   // of the step that was watched last
};

// Nothing is swept any more. Moves that wait stay.
void cutting_rest(struct cutting *cutting);

// The moves that wait are given up; returns how many.
int cutting_drop_waiting(struct cutting *cutting);

// Whether a move of that stroke, or of an older one, waits.
bool cutting_waits(const struct cutting *cutting, uint32_t stroke);

// What is cut from now on are new strokes.
void cutting_end_strokes(struct cutting *cutting);

// A cut of that stroke changed the tissue.
void cutting_landed(struct cutting *cutting, uint32_t stroke, int64_t time_ns);

// Watches all instruments of a step: a move that is due waits, and its sweep begins anew. Before
// rule 2 none waits: a move that is due grows until it is taken. Returns how many moves found no
// room and are not cut.
int cutting_watch(struct cutting *cutting, const struct scene *scene,
                  const struct session_output *out);

// True where there is something to be cut: the moves that have waited for the longest go into
// *out_job, those of one instrument, tissue and stroke that follow each other.
bool cutting_take(struct cutting *cutting, struct job *out_job);
