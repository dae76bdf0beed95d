// Hands that cut, grasp and press anything at random, for tests of sessions. The scene has loose
// bodies, and the session a grasper behind the usual instruments.
#pragma once

#include "random.h"
#include "step/session.h"

struct busy_hands {
    const struct scene *scene;
    struct random random;
    int64_t time_ns;
    uint64_t number;
    vec3 tips[INSTRUMENT_COUNT], targets[INSTRUMENT_COUNT];
    double openings[INSTRUMENT_COUNT], closing[INSTRUMENT_COUNT];
    bool runs;
    double flexion_deg;
};

struct busy_hands busy_hands_begin(const struct scene *scene, uint64_t seed);

// After the output `out`; pending: the result that has not landed, or NULL.
void busy_hands_next(struct busy_hands *hands, const struct session_output *out,
                     const struct job_result *pending, struct session_input *out_input);
