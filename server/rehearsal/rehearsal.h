// Hands that try a task on a case, computed: an expert's, planned from the task's goals, and a
// novice's. They play in a session of their own, and the attempt is judged as a trainee's is. So
// they tell whether a task can be done on a case, and whether its pass mark separates the two.
#pragma once

#include "motion/motion.h"
#include "task/attempt.h"

enum rehearsal_hands {
    HANDS_EXPERT, // straight to each goal
    HANDS_NOVICE  // slower, with a tremor and detours, the same ones for a seed
};

struct rehearsal {
    struct motion motion;
    struct attempt attempt;
    int goal;                     // the first that the hands did not meet, -1: all are met
    struct motion_script *script; // of the motion
};

// The case for hands, and a scene of it: a scene takes a case for its own. The caller destroys both
// even after an error. Errors are those of case_load and scene_create.
enum result rehearsal_load(const char *dir, struct knee_case **out_knee, struct scene **out_scene,
                           struct error *err);

// `knee` is the case of the scene, loaded again; it gets landmarks and portals where it has none.
// `progress`: after each goal, how many are done; NULL is fine.
// RESULT_OK: the hands went as far as rehearsal->goal tells; where they did not meet it, *err says
// why. Otherwise what site_create and motion_plan refuse. The caller releases the rehearsal with
// rehearsal_fini.
enum result rehearse(const struct task *task, struct knee_case *knee, const struct scene *scene,
                     enum rehearsal_hands hands, int64_t seed, void (*progress)(int done, int all),
                     struct rehearsal *out, struct error *err);
void rehearsal_fini(struct rehearsal *rehearsal); // a zeroed one is fine

// A novice's hands after an expert's that met all goals, for the seed. Results as rehearse.
enum result rehearse_novice(const struct task *task, struct knee_case *knee,
                            const struct scene *scene, const struct rehearsal *expert, int64_t seed,
                            struct rehearsal *out, struct error *err);
