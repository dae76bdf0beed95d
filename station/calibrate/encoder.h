// Zero and scale of an encoder: the straight line of least squares through known values.
#pragma once

#include "base/result.h"

#define ENCODER_COUNTS_MIN 10.0

struct encoder_fit {
    double scale, offset; // value = scale · reading + offset
    double rms, max;      // of what is left, in the value's unit
};

// RESULT_MISSING: fewer than two readings. RESULT_INVALID: all within ENCODER_COUNTS_MIN of each
// other, or not finite. *out is then not written.
enum result encoder_calibrate(const double *readings, const double *values, int count,
                              struct encoder_fit *out, struct error *err);
