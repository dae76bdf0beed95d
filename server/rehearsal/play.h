// Plays a motion through a session of its own, and judges it.
#pragma once

#include "motion/motion.h"
#include "task/attempt.h"

struct session_input;
struct operation;

// Gets each step.
struct play_watch {
    void *user;
    void (*step)(void *user, const struct session_input *input,
                 const struct session_output *output);
};

// A motion that grows while it is played.
struct play;

// The session has the default settings; jobs land after 0.1 s. watch: NULL is fine. The scene and
// the site must outlive the play, which the caller destroys.
struct play *play_create(double rate_hz, const struct scene *scene, const struct site *site,
                         const struct play_watch *watch);
void play_destroy(struct play **play); // NULL inside is fine

// Plays the rows that were not played yet, until the attempt ends. The motion's earlier rows are
// those of the call before.
void play_on(struct play *play, const struct motion *motion);

const struct attempt *play_attempt(const struct play *play);
size_t play_rows(const struct play *play);           // that were played
vec3 play_loose(const struct play *play, int index); // its middle as it is shown, mock-up's frame
const struct operation *play_operation(const struct play *play);

// All of it. The attempt is left in the end.
void play_motion(const struct motion *motion, double rate_hz, const struct scene *scene,
                 const struct site *site, const struct play_watch *watch,
                 struct attempt *out_attempt);
