#include "base/check.h"
#include "rehearsal/planner.h"

#include <math.h>

#define BITES 30      // of a round
#define ROUNDS 9      // from one stance
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

enum way { BITE_BELOW, BITE_ABOVE, SHAVE, WAY_COUNT };

struct round {
    const struct stance *stance;
    enum way way;
    bool enters; // the punch is not inside in this stance yet
    double gained_mm3;
};

static void add_bites(struct planner *p, const char *group, const struct round *round,
                      const struct motion_left *left) {
    if (round->enters)
        add_named(p->trial, MOTION_APPROACH, CHANNEL_PUNCH, p->portals[1]);
    struct motion_step *step = add_named(p->trial, MOTION_RESECT, CHANNEL_PUNCH, group);
    if (!step)
        return;
    step->count = BITES;
    step->left = left;
    step->from_above = round->way == BITE_ABOVE;
}

// Along the whole margin of the plan: it takes what the jaws have left standing.
static void add_shave(struct planner *p, const char *group) {
    add_named(p->trial, MOTION_WITHDRAW, CHANNEL_PUNCH, "");
    add_named(p->trial, MOTION_APPROACH, CHANNEL_SHAVER, p->portals[1]);
    add_named(p->trial, MOTION_TRACE, CHANNEL_SHAVER, group);
    add_named(p->trial, MOTION_WITHDRAW, CHANNEL_SHAVER, "");
}

static void add_round(struct planner *p, const struct goal *goal, const struct round *round,
                      const struct motion_left *left) {
    *p->trial = *p->script;
    if (round->enters) {
        hold_joint(p->trial, goal, round->stance);
        add_named(p->trial, MOTION_LOOK, CHANNEL_SCOPE, goal->resect);
    }
    if (round->way == SHAVE)
        add_shave(p, goal->resect);
    else
        add_bites(p, goal->resect, round, left);
}

static bool is_too_much(const struct goal *goal, const struct quality_report *report) {
    return report->over_mm3 > goal->over_share * report->planned_mm3 ||
           report->rim_mm < goal->rim_mm;
}

// True if the goal is met. A round that took something of the plan, and not too much beyond it,
// stays in the script.
static bool try_round(struct planner *p, int index, struct round *round) {
    const struct goal *goal = &p->task->goals[index];
    int tissue = site_goal(p->site, index)->tissue;
    const struct quality_report *report = &p->out->attempt.resections[tissue];
    const struct motion_left *left = find_left(p, goal->resect, tissue);
    double before = p->out->attempt.cut >> tissue & 1 ? report->under_mm3 : INFINITY;
    round->gained_mm3 = 0;
    if (!left)
        return false;
    add_round(p, goal, round, left);
    int bitten = p->trial->step_count;
    add_amount(p->trial, MOTION_WAIT, goal->hold_s + SETTLE_S);
    if (try_script(p, p->trial) != RESULT_OK)
        return false;
    bool met = p->out->attempt.goals[index].met;
    if (!met && (report->under_mm3 >= before || is_too_much(goal, report))) {
        try_script(p, p->script);
        return false;
    }
    round->gained_mm3 = before - report->under_mm3;
    round->enters = round->way == SHAVE;
    if (!met)
        p->trial->step_count = bitten;
    *p->script = *p->trial;
    return met;
}

bool meet_resection(struct planner *p, int index) {
    const struct goal *goal = &p->task->goals[index];
    if (try_script(p, p->script) != RESULT_OK)
        return false;
    for (int s = 0; s < STANCE_COUNT; s++) {
        struct round round = {.stance = &stances[s], .enters = true};
        for (int i = 0, idle = 0; i < ROUNDS && idle < WAY_COUNT; i++) {
            round.way = i % WAY_COUNT;
            if (try_round(p, index, &round))
                return true;
            idle = round.gained_mm3 > WORTH_MM3 ? 0 : idle + 1;
        }
    }
    const struct quality_report *report =
        &p->out->attempt.resections[site_goal(p->site, index)->tissue];
    fail(p->err, RESULT_INVALID,
         "[goal %s]: of a plan of %.0f mm3, %.0f are still there and %.0f are gone beyond it",
         goal->name, report->planned_mm3, report->under_mm3, report->over_mm3);
    return false;
}
