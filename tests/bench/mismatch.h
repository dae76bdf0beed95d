// How far the touched surface S'' is from the cut mesh T, in volume and in distance.
#pragma once

#include "case/case.h"
#include "samples.h"

#define COLUMN_MM 0.08

struct mismatch {
    double touched_mm3; // inside S'' and outside T: touched where nothing is seen
    double seen_mm3;    // inside T and outside S''
    double cut_mm3;     // inside S' and outside T
};

// Along columns COLUMN_MM apart, in the direction of z. Clefts, the parts of `tear`, count in none.
void mismatch_measure(const struct mesh *whole, const struct mesh *touched, const struct mesh *cut,
                      const struct case_region *tear, struct mismatch *out);

// Distances to `to` of points that lie evenly over the triangles of `from` that are `fresh`, films
// left out: places of it thinner than 0.15 mm.
// RESULT_IO where Embree cannot build.
enum result mismatch_distances(const struct mesh *from, const bool *fresh, const struct mesh *to,
                               struct samples *out, struct error *err);
