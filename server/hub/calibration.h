// Whether a station's calibration is still good enough, and how far the touches of a session are
// from it.
#pragma once

#include "hub/hub.h"
#include "wire/wire.h"

// A sentence for people where the calibration is older or worse than the config allows, or of a day
// to come; empty where it is good. At most 127 bytes.
void calibration_judge(const arthron_Calibration *calibration, const struct hub_config *config,
                       int64_t now_utc_s, char *out_text, size_t size);

// The drift of one instrument. While its contact switch is closed, its tip is on the replica, and
// the measured distance to the nearest surface should be 0. One touch is one closing of the switch;
// its residual is the mean of that distance; `mean_mm` is the running mean of the last
// DRIFT_TOUCHES residuals. A zeroed struct drift knows nothing.
#define DRIFT_TOUCHES 16

struct drift {
    uint64_t touches; // that had a measured distance
    double mean_mm;
    int steps; // of the touch that goes on
    double sum_mm;
};

// Once for each step: the switch, and the distance (negative: not measured at this step). True
// where a touch has just ended.
bool drift_step(struct drift *drift, bool closed, double distance_mm);
