// Plays a motion through a session of its own, and judges it.
#pragma once

#include "motion/motion.h"
#include "task/attempt.h"

struct session_input;

// Gets each step.
struct play_watch {
    void *user;
    void (*step)(void *user, const struct session_input *input,
                 const struct session_output *output);
};

// The session has the default settings; jobs land after 0.1 s. watch: NULL is fine. out_tissues:
// NULL, or of each tissue of the scene the patient's mesh as it is cut in the end, which the caller
// releases.
void play_motion(const struct motion *motion, double rate_hz, const struct scene *scene,
                 const struct site *site, const struct play_watch *watch,
                 struct attempt *out_attempt, struct mesh *out_tissues);
