// Plays a motion through a session of its own, and judges it. For this room only.
#pragma once

#include "motion/motion.h"
#include "task/attempt.h"

// The session has the default settings; jobs land after 0.1 s. out_tissues: NULL, or of each
// tissue of the scene the patient's mesh as it is cut in the end, which the caller releases.
void play_motion(const struct motion *motion, double rate_hz, const struct scene *scene,
                 const struct site *site, struct attempt *out_attempt, struct mesh *out_tissues);
