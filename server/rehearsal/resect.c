#include "base/check.h"
#include "rehearsal/planner.h"

#include <math.h>

#define BITES 30      // of a round
#define ROUNDS 6      // from one stance
#define WORTH_MM3 2.0 // less than this from a round, and another stance is tried
#define SETTLE_S 0.4

static const struct stance stances[] = {{10, 8, 0}, {25, 8, 0},  {45, 8, 0},  {5, 8, 0},
                                        {70, 8, 0}, {10, -8, 0}, {90, -8, 0}, {45, -8, 0}};
#define STANCE_COUNT ((int)(sizeof stances / sizeof *stances))

// What is still there of the plan, after what was tried last. NULL: the error says why.
static const struct motion_left *find_left(struct planner *p, const char *group, int tissue) {
    if (p->left_count == LEFTS_MAX) {
        fail(p->err, RESULT_LIMIT, "it takes more than %d rounds of bites", LEFTS_MAX);
        return NULL;
    }
    struct motion_left *left = alloc(1, sizeof *left);
    p->lefts[p->left_count++] = left;
    bool found = motion_left(p->knee, group, &p->tissues[tissue], left, p->err) == RESULT_OK;
    return found ? left : NULL;
}

struct round {
    const struct stance *stance;
    bool enters;     // the hands are not in this stance yet
    bool from_above; // the punch is turned over
    double gained_mm3;
};

static void add_round(struct planner *p, const struct goal *goal, const struct round *round,
                      const struct motion_left *left) {
    struct motion_script *script = p->trial;
    if (round->enters) {
        hold_joint(script, goal, round->stance);
        add_named(script, MOTION_LOOK, CHANNEL_SCOPE, goal->resect);
        add_named(script, MOTION_APPROACH, CHANNEL_PUNCH, p->portals[1]);
    }
    struct motion_step *step = add_named(script, MOTION_RESECT, CHANNEL_PUNCH, goal->resect);
    if (!step)
        return;
    step->count = BITES;
    step->left = left;
    step->from_above = round->from_above;
}

// True if the goal is met. A round that took something of the plan stays in the script.
static bool try_round(struct planner *p, int index, struct round *round) {
    const struct goal *goal = &p->task->goals[index];
    int tissue = site_goal(p->site, index)->tissue;
    const struct quality_report *report = &p->out->attempt.resections[tissue];
    const struct motion_left *left = find_left(p, goal->resect, tissue);
    double before = p->out->attempt.cut >> tissue & 1 ? report->under_mm3 : INFINITY;
    round->gained_mm3 = 0;
    if (!left)
        return false;
    *p->trial = *p->script;
    add_round(p, goal, round, left);
    int bitten = p->trial->step_count;
    add_amount(p->trial, MOTION_WAIT, goal->hold_s + SETTLE_S);
    if (try_script(p, p->trial) != RESULT_OK)
        return false;
    bool met = p->out->attempt.goals[index].met;
    round->gained_mm3 = before - report->under_mm3;
    if (!met)
        p->trial->step_count = bitten;
    if (round->gained_mm3 > 0 || met) {
        round->enters = false;
        *p->script = *p->trial;
    }
    return met;
}

bool meet_resection(struct planner *p, int index) {
    const struct goal *goal = &p->task->goals[index];
    if (try_script(p, p->script) != RESULT_OK)
        return false;
    for (int s = 0; s < STANCE_COUNT; s++) {
        struct round round = {.stance = &stances[s], .enters = true};
        for (int i = 0, idle = 0; i < ROUNDS && idle < 2; i++) {
            if (try_round(p, index, &round))
                return true;
            idle = round.gained_mm3 > WORTH_MM3 ? 0 : idle + 1;
            round.from_above = !round.from_above;
        }
    }
    const struct quality_report *report =
        &p->out->attempt.resections[site_goal(p->site, index)->tissue];
    fail(p->err, RESULT_INVALID,
         "[goal %s]: of a plan of %.0f mm3, %.0f are still there and %.0f are gone beyond it",
         goal->name, report->planned_mm3, report->under_mm3, report->over_mm3);
    return false;
}
