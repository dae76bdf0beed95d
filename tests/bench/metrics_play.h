// Hands at work, and the same hands measured worse: the figures of each.
#pragma once

#include "motion/motion.h"
#include "metrics/metrics.h"

struct hands_row {
    double t_seconds;
    struct joint_angles joint;
    bool valid[INSTRUMENT_COUNT]; // there is a sample
    pose T_mockup_tip[INSTRUMENT_COUNT];
};

struct hands_at_work {
    char name[64];
    int row_count;
    struct hands_row *rows;
    const struct scene *scene; // they work on; NULL: the warp moves nothing
};

// Of a file in the shared data's folder of trackers, as the probe; beside it as the scope the same
// hand mirrored and 5 s later, where the file is long enough. RESULT_MISSING where there is no such
// file.
enum result hands_recorded(const char *file, struct hands_at_work *out, struct error *err);
void hands_of_motion(const struct motion *motion, const struct scene *scene, const char *name,
                     struct hands_at_work *out);
void hands_at_work_fini(struct hands_at_work *hands); // a zeroed one is fine

enum worse {
    AS_IT_IS,
    WORSE_NOISE,   // 0.1 mm (standard deviation) in each direction
    WORSE_RATE,    // every other sample
    WORSE_DROPPED, // 5 % of samples
    WORSE_COUNT
};

#define FIGURES_MAX 1024

struct figures {
    double step_ns; // of metrics_step, in the mean, with the clock's own time
    int count;
    struct metric_value values[FIGURES_MAX];
};

void hands_play(const struct hands_at_work *hands, enum worse worse, uint64_t seed,
                struct figures *out);
