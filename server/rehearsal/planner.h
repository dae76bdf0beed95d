// What the parts of a rehearsal share. For this room only.
#pragma once

#include "rehearsal/rehearsal.h"

#define LEFTS_MAX 64 // rounds of a resection

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
    const char *portals[2]; // of the scope, and of the other hand
    struct motion_script *script, *trial;
    struct mesh tissues[TISSUES_MAX]; // of the patient, after what was tried last
    int left_count;
    struct motion_left *lefts[LEFTS_MAX]; // that steps of the scripts point to
    struct rehearsal *out;
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

// The joint a little beyond what the goal asks, or as the stance has it.
void hold_joint(struct motion_script *script, const struct goal *goal, const struct stance *stance);

// ---- trying (rehearsal.c) ----

// Plays the script so far. RESULT_OK: it could be planned.
enum result try_script(struct planner *p, const struct motion_script *script);

// ---- resections (resect.c) ----

// Bites where the plan is still there, from stance after stance, until the goal is met.
bool meet_resection(struct planner *p, int goal);

// ---- a novice (novice.c) ----

// Makes p->trial of the expert's script.
void become_novice(struct planner *p, int64_t seed);
