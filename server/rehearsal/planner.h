// What the parts of a rehearsal share. For this room only.
#pragma once

#include "motion/move.h"
#include "rehearsal/play.h"

// How the joint is held where a goal does not say it, and from where the scope looks, mm (0: as it
// comes).
struct stance {
    double flexion_deg, valgus_deg, distance;
};

struct planner {
    const struct task *task;
    struct knee_case *knee;
    const struct scene *scene;
    struct site *site;
    const char *portals[2];       // of the scope, and of the other hand
    struct motion_script *script; // what the hands have done so far
    struct plan plan;
    struct play *play; // of the script's motion
    struct error *err;
};

// ---- steps (steps.c): nothing is added to a script that is full ----

struct motion_step *add_step(struct motion_script *script, enum motion_verb verb); // NULL: full
void add_amount(struct motion_script *script, enum motion_verb verb, double amount);
struct motion_step *add_named(struct motion_script *script, enum motion_verb verb,
                              enum channel tool, const char *name);
struct motion_step *add_place(struct motion_script *script, enum motion_verb verb,
                              enum channel tool, const char *group, const char *from,
                              const char *to);

// Of the knee, as a motion has it: its places are those of a right knee.
vec3 place_of(const struct knee_case *knee, vec3 at);

// The joint a little beyond what the goal asks, or as the stance has it.
void hold_joint(struct planner *p, const struct goal *goal, const struct stance *stance);

// All but the scope leave the knee: what waits there while the joint moves and the scope looks
// elsewhere works unseen.
void take_out_tools(struct planner *p);

// Plans the script's steps from this one on, and nothing if one of them is refused: then the script
// is as long as it was before them.
bool plan_from(struct planner *p, int step);

// ---- resections (resect.c) ----

// Bites where the plan is still there, from stance after stance, until the goal is met. The hand
// sees after each bite what is left.
bool meet_resection(struct planner *p, int goal);

// ---- a novice (novice.c) ----

// What a novice does of an expert's script.
void become_novice(const struct motion_script *expert, const struct knee_case *knee, int64_t seed,
                   struct motion_script *out_script);
