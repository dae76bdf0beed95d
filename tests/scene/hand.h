// A session on the generated healthy knee and an instrument in a hand, led by the test itself.
#pragma once

#include "base/clock.h"
#include "step/session.h"

#define STEP_NS NS_PER_MS

extern struct scene *scene;
extern const struct case_group *meniscus;
extern vec3 inner, outward;        // a point of its inner margin, and from there to the rim
extern enum field_kind hand_field; // of the sessions to come

int hand_make_scene(void **state);
int hand_drop_scene(void **state);
uint32_t most_moved(const struct case_group *group); // the vertex that its maxcut takes farthest

struct hand {
    struct session *session;
    struct operation *operation;
    struct session_input input;
    struct session_output out;
    struct job_result *pending;
    bool probe_is_there, knife_is_there, tibia_is_tracked;
    vec3 probe, knife;
    double length;        // of all rotations
    enum channel channel; // of the instrument in hand
    double opening;
    uint32_t buttons;
    enum validity handle;
    vec3 tip;
};

// At the margin, the jaw open. The caller ends it.
struct hand hand_start(void);
void hand_end(struct hand *hand);

void step(struct hand *hand); // a frame, a millisecond later; a job that it asks for is run
void run_job(struct hand *hand);
void give(struct hand *hand, enum input_kind kind, uint64_t job, const struct job_result *result);
struct landed land(struct hand *hand);

void close_to_job(struct hand *hand); // closes the jaw as far as to the next job
struct landed bite(struct hand *hand);
