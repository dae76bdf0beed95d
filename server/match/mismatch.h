// Where the touched surface S'' and the tissue that is seen differ: in volume, and at each vertex.
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
    double step_mm;               // between the columns along z on which they are compared
    const uint32_t *triangle_ids; // of each triangle of the tissue: the one of S'' that it may be,
                                  // or a number that none has; NULL: nobody knows
};

void mismatch_measure(const struct mismatch_setting *setting, struct mismatch *out_mismatch);

#define MISMATCH_REACH_MM 10.0 // farther counts as so far

// How far S'' lies from the tissue's surface at each of its vertices, mm: from the vertex to the
// nearest point of S''. Positive where the vertex is inside S'': touched where nothing is seen.
// Negative outside: seen where nothing is touched. 0 in a cleft and on its walls. step_mm is not
// used. ids: of each vertex of the tissue the one of S'' that it was made from, or a number that
// no vertex of S'' has.
void mismatch_at_vertices(const struct mismatch_setting *setting, const uint32_t *ids,
                          double *out_mm);
