// The tissue of a session from cut to cut, as it is seen.
#pragma once

#include "export/contents.h"

// A tissue after a cut.
struct cut_mesh_state {
    uint64_t step; // at which it landed
    int tissue;
    struct mesh mesh;
};

struct tissue_states {
    struct mesh before[TISSUES_MAX]; // as it was before the first step
    struct cut_mesh_state *cuts;     // in the order of the steps
    int cut_count;
};

// One pass (landings_run). The request has a scene.
enum result tissue_states_read(struct walk *walk, struct tissue_states *out_states,
                               struct error *err);
void tissue_states_fini(struct tissue_states *states); // a zeroed one is fine
