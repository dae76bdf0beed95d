// S'_max: what the greatest resection leaves of a meniscus. A rim at the capsule; the horns' roots
// keep all. As a displacement of S' (struct case_group's maxcut).
#pragma once

#include "case/case.h"
#include "mesh/fold.h"

#define MAXCUT_RIM_MM 3.5 // what is usually left
#define MAXCUT_RIM_LEAST_MM 2.0
#define MAXCUT_RIM_MOST_MM 8.0

// Makes the group's maxcut anew. In plan (case/arc.h) a vertex t mm from the outer margin, where
// the C is w wide, goes to
//
//     t' = t for t <= k, k + (t - k) (rim - k) / (w - k) beyond, k = rim - rim_mm / 2
//
// in the body; towards the ends, by a smooth share of that. Between the lower and the upper side it
// keeps its relative height, with the two taken 0.05 mm into the tissue: the map is one to one. The
// rim is rim_mm wide; wider where S' is hollow there and points would leave it. Vertices that stick
// out all the same are drawn in, folds smoothed.
// RESULT_INVALID, and nothing has changed: no cuttable group, no C, or nowhere wider than the rim.
enum result maxcut_make(struct case_group *group, pose T_body_joint, double rim_mm,
                        struct error *err);

#define MAXCUT_TOLERANCE_MM 0.02

// The points of a triangle that are looked at: its corners, the middles of its sides, its own.
#define MAXCUT_SAMPLES 7
vec3 maxcut_sample(const struct mesh *mesh, uint32_t triangle, int sample);

struct maxcut_report {
    uint32_t samples;                 // of all triangles of S'_max
    uint32_t out_count;               // of these farther outside S' than the tolerance
    double deepest_mm;                // the farthest
    struct folds folds;               // of S'_max, where S' has none
    double whole_mm3, least_mm3;      // inside S' and S'_max: the cut budget lies between
    double plan_mm3, plan_beyond_mm3; // of the planned resection in the tissue, and how much of
                                      // that is inside S'_max, by samples of 0.25 mm
};

// Whatever made the maxcut: this or somebody's hands. The group is cuttable and has one.
// RESULT_IO where Embree cannot build.
enum result maxcut_inspect(const struct case_group *group, struct maxcut_report *out_report,
                           struct error *err);
