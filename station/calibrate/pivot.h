// Pivot calibration: the tip of a tool that is turned about its tip, which stays where it is.
//
// Least squares over all poses of R t + p = q for the tip t in the tool's frame and the point q in
// the tracker's.
#pragma once

#include "base/pose.h"
#include "base/result.h"

#define PIVOT_POSES_MIN 20
#define PIVOT_TURN_DEG 5.0

struct pivot {
    vec3 tip_mm;   // in the tool's frame
    vec3 point_mm; // where it stood, in the tracker's frame
    double rms_mm; // how far the tip was from there
    double max_mm;
    double turn_deg; // how far the poses turn about the second of their axes (root mean square)
};

// RESULT_MISSING: fewer than PIVOT_POSES_MIN poses. RESULT_INVALID: they turn less than
// PIVOT_TURN_DEG, or about one axis only, on which the tip might lie anywhere. *out is then not
// written.
enum result pivot_calibrate(const pose *T_tracker_tool, int count, struct pivot *out,
                            struct error *err);
