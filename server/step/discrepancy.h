// The part of the warp that a trainee might notice: the difference of the shown tip from the
// measured one, and of its motion from the hand's. The thresholds are those of hands that are
// redirected in a headset (Zenner, Krüger, IEEE VR 2019); a tool held in the hand tolerates more.
#pragma once

#include "base/extrapolation.h"

#define NOTICED_TURN_DEG 4.5
#define NOTICED_GAIN_LEAST 0.88
#define NOTICED_GAIN_MOST 1.07

struct discrepancy {
    double offset_mm; // |Δ| of the tip
    double tilt_deg;  // of the shaft
    // Of F, the shown tip's motion over the hand's, without turning the hand:
    double gain;       // its largest stretch
    double gain_least; // the least; negative where space folds
    double turn_deg;   // its rotation: 180 where space folds
};

// `shown` is the extrapolation's own, at the tip's pose that it was made for. F is its derivative;
// by differences it is as sessions before RULES_BY_DERIVATIVE had it (step/settings.h).
struct discrepancy discrepancy_of(const struct avatar_extrapolation *extrapolation, pose tip,
                                  pose shown, bool by_differences);

bool discrepancy_is_noticed(const struct discrepancy *discrepancy); // past one of the thresholds
