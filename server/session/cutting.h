// Which instruments cut, and when a move of one is long enough to be a job. For session.c only.
#pragma once

#include "session/scene.h"

// One instrument and one tissue: since when its blade moves without having cut.
struct sweep {
    bool active;
    pose T_mesh_tip;
    double opening;
    int64_t time_ns;
    vec3 last; // where the tip was at the last step
};

struct cutting {
    struct sweep sweeps[INSTRUMENT_COUNT][TISSUES_MAX];
};

// Watches all instruments of a step. True where a job is due and `may_cut`: the move goes into
// *out_job, and its sweep begins anew; a move that had to wait goes on growing.
bool cutting_step(struct cutting *cutting, const struct scene *scene,
                  const struct session_output *out, bool may_cut, struct job *out_job);
