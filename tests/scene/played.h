// A session on a generated case, played from the script of a first palpation: what a server would
// do with a station, without either.
#pragma once

#include "motion/motion.h"
#include "step/session.h"

struct played {
    struct scene *scene;
    struct motion motion;
};

// Makes the case of a recipe (a folder below `cases`) in `dir`, loads it, and plans the motion.
// The caller releases it with played_fini.
enum result played_init(const char *cases, const char *recipe, const char *dir,
                        struct played *out_played, struct error *err);
void played_fini(struct played *played);

// Runs the session: started, a frame for each of the first `rows` rows of the motion, now and then
// paused, set back, reset, without frames or with a lost sample, stopped at the end. Its jobs are
// run and land a few rows later. `each` gets every step.
void played_run(const struct played *played, const struct session_settings *settings, size_t rows,
                void (*each)(void *context, const struct session_input *input,
                             const struct session_output *output),
                void *context);
