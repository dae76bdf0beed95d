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

struct cutting {
    struct sweep sweeps[INSTRUMENT_COUNT][TISSUES_MAX];
    struct stroke strokes[INSTRUMENT_COUNT];
    uint32_t stroke_count; // ever begun, so that no two have one number
};

// Nothing is swept any more.
void cutting_rest(struct cutting *cutting);

// What is cut from now on are new strokes.
void cutting_end_strokes(struct cutting *cutting);

// A cut of that stroke changed the tissue.
void cutting_landed(struct cutting *cutting, uint32_t stroke, int64_t time_ns);

// Watches all instruments of a step. True where a job is due and `may_cut`: the move goes into
// *out_job, and its sweep begins anew; a move that had to wait goes on growing.
bool cutting_step(struct cutting *cutting, const struct scene *scene,
                  const struct session_output *out, bool may_cut, struct job *out_job);
