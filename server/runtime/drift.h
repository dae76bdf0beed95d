// How far the touches of a session are from the calibration: the drift of one instrument.
//
// While its contact switch is closed, its tip is on the replica, and the measured distance to the
// nearest surface should be 0. One touch is one closing of the switch; its residual is the mean of
// that distance; `mean_mm` is the running mean of the last DRIFT_TOUCHES residuals. A zeroed struct
// drift knows nothing.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define DRIFT_TOUCHES 16

struct drift {
    uint64_t touches; // that had a measured distance
    double mean_mm;
    int steps; // of the present touch
    double sum_mm;
};

// Once for each step: the switch, and the distance (negative: not measured at this step). True
// where a touch has just ended.
bool drift_step(struct drift *drift, bool closed, double distance_mm);
