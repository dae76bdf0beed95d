// Where the touched surface S'' and the tissue that is seen differ, in volume.
#pragma once

#include "mesh/convex.h"
#include "mesh/mesh.h"

struct mismatch {
    double touched_mm3; // inside S'' and outside the tissue: touched where nothing is seen
    double seen_mm3;    // inside the tissue and outside S'': seen where nothing is touched
};

// Both closed. What lies in a cleft of a tear counts in neither.
struct mismatch_setting {
    const struct mesh *touched, *tissue;
    const struct convex *clefts;
    int cleft_count;
    double step_mm; // between the columns along z on which they are compared
};

void mismatch_measure(const struct mismatch_setting *setting, struct mismatch *out_mismatch);
