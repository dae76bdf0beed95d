// Registration of two frames by points that are known in both: the rigid motion of least squares
// (B. K. P. Horn, J. Opt. Soc. Am. A 4, 1987).
#pragma once

#include "base/pose.h"
#include "base/result.h"

#define LANDMARKS_MIN 3
#define LANDMARKS_SPREAD_MM 5.0

struct registration {
    pose T_a_b;
    double rms_mm, max_mm;
};

// in_a[i] and in_b[i] are the same point. out_residuals_mm has room for `count`: how far T_a_b
// in_b[i] is from in_a[i]. RESULT_MISSING: fewer than LANDMARKS_MIN points. RESULT_INVALID: in one
// of the frames they lie within LANDMARKS_SPREAD_MM (root mean square) of a line, about which the
// motion could turn freely. Nothing is written then.
enum result landmarks_register(const vec3 *in_a, const vec3 *in_b, int count,
                               struct registration *out, double *out_residuals_mm,
                               struct error *err);
