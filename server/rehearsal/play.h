// Plays a motion through a session of its own, and judges it. For this room only.
#pragma once

#include "motion/motion.h"
#include "task/attempt.h"

// The session has the default settings; jobs land at the next step.
void play_motion(const struct motion *motion, double rate_hz, const struct scene *scene,
                 const struct site *site, struct attempt *out_attempt);
