#include "rehearsal/rehearsal.h"

#include "base/check.h"
#include "landmarks/landmarks.h"
#include "rehearsal/play.h"
#include "rehearsal/take.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SETTLE_S 0.4 // that hands rest longer than a goal asks
#define BITES 40
#define USUAL_MM 20.0 // from which a scope looks
#define CLEAR_MM 2.0  // inside the bounds of a distance
#define DETOURS 2     // of a novice before each goal

// How the joint is held where a goal does not say it, in the order in which it is tried: each opens
// another place. And from where the scope looks, mm; 0: as it comes.
static const struct stance {
    double flexion_deg, valgus_deg, distance;
} stances[] = {{20, 0, 0},  {20, 8, 0},  {20, -8, 0}, {45, 0, 0},  {70, 0, 0},
               {90, 0, 0},  {90, -8, 0}, {5, 0, 0},   {20, 8, 12}, {20, -8, 12},
               {20, 8, 26}, {90, 0, 26}, {90, -8, 26}};
#define STANCE_COUNT ((int)(sizeof stances / sizeof *stances))

struct planner {
    const struct task *task;
    struct knee_case *knee;
    const struct scene *scene;
    struct site *site;
    uint64_t chance;
    const char *portals[2]; // of the scope, and of the other hand
    struct motion_script *script, *trial;
    struct rehearsal *out;
    struct error *err;
};

// ---- steps --------------------------------------------------------------------------------------

static struct motion_step *add(struct motion_script *script, enum motion_verb verb) {
    if (script->step_count == MOTION_STEPS_MAX)
        return NULL;
    struct motion_step *step = &script->steps[script->step_count++];
    *step = (struct motion_step){.verb = verb};
    return step;
}

static void add_amount(struct motion_script *script, enum motion_verb verb, double amount) {
    struct motion_step *step = add(script, verb);
    if (step)
        step->amount = amount;
}

static struct motion_step *add_named(struct motion_script *script, enum motion_verb verb,
                                     enum channel tool, const char *name) {
    struct motion_step *step = add(script, verb);
    if (!step)
        return NULL;
    step->tool = tool;
    snprintf(step->name, sizeof step->name, "%s", name);
    return step;
}

static struct motion_step *add_place(struct motion_script *script, enum motion_verb verb,
                                     enum channel tool, const char *group, const char *from,
                                     const char *to) {
    struct motion_step *step = add_named(script, verb, tool, group);
    if (!step)
        return NULL;
    step->has_place = true;
    snprintf(step->from.landmark, sizeof step->from.landmark, "%s", from);
    snprintf(step->to.landmark, sizeof step->to.landmark, "%s", to);
    return step;
}

// ---- a goal as steps ----------------------------------------------------------------------------

static const char *group_name(const struct planner *p, const struct spot *spot) {
    return p->knee->groups[spot->group].name;
}

static double clamped(double value, double most) {
    return fmin(fmax(value, -most), most);
}

// A little more than the goal asks, and no more than a knee gives.
static void hold_joint(struct motion_script *script, const struct goal *goal,
                       const struct stance *stance) {
    double flexion = stance->flexion_deg, valgus = stance->valgus_deg, more = 1.2;
    if (!isnan(goal->flexion_from_deg))
        flexion = 0.5 * (goal->flexion_from_deg + goal->flexion_to_deg);
    if (!isnan(goal->valgus_deg))
        valgus = more * goal->valgus_deg;
    if (!isnan(goal->varus_deg))
        valgus = -more * goal->varus_deg;
    add_amount(script, MOTION_FLEX, fmax(clamped(flexion, 140), 0));
    add_amount(script, MOTION_VALGUS, clamped(valgus, 15));
    if (!isnan(goal->drawer_mm))
        add_amount(script, MOTION_DRAWER, clamped(more * goal->drawer_mm, 10));
}

static enum channel channel_of(const struct site_goal *g) {
    return (enum channel)(CHANNEL_FIRST_INSTRUMENT + g->tool);
}

static void resect(const struct planner *p, struct motion_script *script, const char *group) {
    add_named(script, MOTION_APPROACH, CHANNEL_PUNCH, p->portals[1]);
    struct motion_step *step = add_named(script, MOTION_RESECT, CHANNEL_PUNCH, group);
    if (step)
        step->count = BITES;
    add_named(script, MOTION_WITHDRAW, CHANNEL_PUNCH, "");
}

static void touch(const struct planner *p, struct motion_script *script, const struct goal *goal,
                  const struct site_goal *g) {
    enum channel tool = channel_of(g);
    const char *group = group_name(p, &g->touch);
    if (goal->touch[0])
        add_place(script, MOTION_TOUCH, tool, group, goal->touch, "");
    for (int i = 1; i < goal->place_count; i++)
        add_place(script, MOTION_PALPATE, tool, group, goal->follow[i - 1], goal->follow[i]);
}

static void look_at(const struct planner *p, struct motion_script *script, const struct spot *spot,
                    const char *landmark, double distance) {
    struct motion_step *step =
        add_place(script, MOTION_LOOK, CHANNEL_SCOPE, group_name(p, spot), landmark, "");
    if (step)
        step->amount = distance;
}

static void look(const struct planner *p, struct motion_script *script, const struct goal *goal,
                 const struct site_goal *g, double distance) {
    bool is_far = goal->beyond_mm > 0, is_near = goal->within_mm < USUAL_MM;
    if (goal->see[0] && (is_far || is_near))
        look_at(p, script, &g->see, goal->see,
                is_far ? goal->beyond_mm + CLEAR_MM : goal->within_mm - CLEAR_MM);
    else if (goal->see[0])
        look_at(p, script, &g->see, goal->see, distance);
    else if (goal->touch[0])
        look_at(p, script, &g->touch, goal->touch, distance);
    else if (goal->place_count)
        look_at(p, script, &g->touch, goal->follow[0], distance);
}

static bool needs_tool(const struct goal *goal) {
    return goal->touch[0] || goal->place_count;
}

static void pursue(const struct planner *p, struct motion_script *script, int index,
                   const struct stance *stance) {
    const struct goal *goal = &p->task->goals[index];
    const struct site_goal *g = site_goal(p->site, index);
    hold_joint(script, goal, stance);
    look(p, script, goal, g, stance->distance);
    if (needs_tool(goal))
        touch(p, script, goal, g);
    if (goal->resect[0])
        resect(p, script, goal->resect);
    if (goal->take_out[0])
        take_out(script, p->knee, g->loose, p->portals[1], stance->distance);
    add_amount(script, MOTION_WAIT, goal->hold_s + SETTLE_S);
}

// ---- a novice's detours -------------------------------------------------------------------------

static uint64_t roll(struct planner *p) { // splitmix64
    uint64_t z = p->chance += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
}

// Looks somewhere else and waits.
static void stray(struct planner *p, struct motion_script *script) {
    for (int i = 0; i < DETOURS && p->knee->landmark_count; i++) {
        uint64_t which = roll(p) % (uint64_t)p->knee->landmark_count;
        const struct case_landmark *landmark = &p->knee->landmarks[which];
        add_place(script, MOTION_LOOK, CHANNEL_SCOPE, body_name(landmark->body), landmark->name,
                  "");
        add_amount(script, MOTION_WAIT, 1 + (double)(roll(p) % 3));
    }
}

// The expert's steps, slower, with a tremor and a detour before each look.
static void become_novice(struct planner *p) {
    struct motion_script *novice = p->trial;
    *novice = *p->script;
    novice->speed_mm_s = novice->joint_speed_deg_s = 12;
    novice->tremor_mm = 0.8;
    novice->skips = true;
    novice->step_count = 0;
    for (int i = 0; i < p->script->step_count; i++) {
        if (p->script->steps[i].verb == MOTION_LOOK)
            stray(p, novice);
        struct motion_step *step = add(novice, p->script->steps[i].verb);
        if (step)
            *step = p->script->steps[i];
    }
}

// ---- trying -------------------------------------------------------------------------------------

// Plays the script so far. RESULT_OK: it could be planned.
static enum result try(struct planner *p, const struct motion_script *script) {
    struct motion motion = {0};
    enum result result = motion_plan(p->knee, script, &motion, p->err);
    if (result != RESULT_OK) {
        motion_fini(&motion);
        return result;
    }
    motion_fini(&p->out->motion);
    p->out->motion = motion;
    play_motion(&motion, script->rate_hz, p->scene, p->site, &p->out->attempt);
    return RESULT_OK;
}

static bool try_stance(struct planner *p, int goal, const struct stance *stance) {
    *p->trial = *p->script;
    pursue(p, p->trial, goal, stance);
    if (try(p, p->trial) != RESULT_OK)
        return false;
    if (p->out->attempt.goals[goal].met) {
        *p->script = *p->trial;
        return true;
    }
    fail(p->err, RESULT_INVALID, "the hands get there, but its conditions do not hold together");
    return false;
}

// The expert tries stances until one meets the goal.
static bool meet(struct planner *p, int goal) {
    struct error first = {""};
    for (int i = 0; i < STANCE_COUNT; i++) {
        if (try_stance(p, goal, &stances[i]))
            return true;
        if (i == 0)
            first = *p->err;
    }
    *p->err = first;
    fail_in(p->err, RESULT_INVALID, "[goal %s]: ", p->task->goals[goal].name);
    return false;
}

// ---- the whole ----------------------------------------------------------------------------------

static void begin(struct planner *p) {
    *p->script = (struct motion_script){
        .rate_hz = 100, .speed_mm_s = 40, .joint_speed_deg_s = 30, .tremor_mm = 0.05, .seed = 1};
    add_named(p->script, MOTION_APPROACH, CHANNEL_SCOPE, p->portals[0]);
    for (int i = 0; i < p->task->goal_count; i++)
        if (needs_tool(&p->task->goals[i])) {
            add_named(p->script, MOTION_APPROACH, channel_of(site_goal(p->site, i)), p->portals[1]);
            return;
        }
}

// How many goals were met.
static int pursue_all(struct planner *p, const char *scope, const char *other,
                      void (*progress)(int, int)) {
    p->portals[0] = scope;
    p->portals[1] = other;
    begin(p);
    for (int i = 0; i < p->task->goal_count; i++) {
        if (!meet(p, i))
            return i;
        if (progress)
            progress(i + 1, p->task->goal_count);
    }
    return p->task->goal_count;
}

// Either hand on the scope: the one that gets farther.
static void try_both_hands(struct planner *p, void (*progress)(int, int)) {
    const struct case_portal *portals = p->knee->portals;
    struct error why;
    int met = pursue_all(p, portals[0].name, portals[1].name, progress);
    p->out->goal = met == p->task->goal_count ? -1 : met;
    if (met == p->task->goal_count)
        return;
    why = *p->err;
    struct rehearsal before = *p->out;
    p->out->motion = (struct motion){0};
    int other = pursue_all(p, portals[1].name, portals[0].name, progress);
    if (other > met) {
        p->out->goal = other == p->task->goal_count ? -1 : other;
        rehearsal_fini(&before);
        return;
    }
    rehearsal_fini(p->out);
    *p->out = before;
    *p->err = why;
}

// The case gets what the hands need, as motion_plan gives it.
static enum result prepare(struct planner *p, struct knee_case *knee) {
    double clear_mm[2];
    enum result result = RESULT_OK;
    if (knee->landmark_count == 0)
        result = landmarks_find(knee, NULL, p->err);
    if (result == RESULT_OK && knee->portal_count == 0)
        result = landmarks_find_portals(knee, clear_mm, p->err);
    if (result == RESULT_OK && knee->portal_count < 2)
        result = fail(p->err, RESULT_MISSING, "the case has one portal; a task needs two");
    return result;
}

enum result rehearse(const struct task *task, struct knee_case *knee, const struct scene *scene,
                     enum hands hands, int64_t seed, void (*progress)(int done, int all),
                     struct rehearsal *out, struct error *err) {
    struct motion_script *scripts = alloc(2, sizeof *scripts);
    struct planner p = {.task = task,
                        .knee = knee,
                        .scene = scene,
                        .chance = (uint64_t)seed,
                        .script = &scripts[0],
                        .trial = &scripts[1],
                        .out = out,
                        .err = err};
    struct view_optic optic = view_optic_usual();
    *out = (struct rehearsal){.goal = -1};
    enum result result = site_create(task, scene, instruments_of_hands(), &optic, &p.site, err);
    if (result == RESULT_OK)
        result = prepare(&p, knee);
    if (result == RESULT_OK)
        try_both_hands(&p, progress);
    if (result == RESULT_OK && hands == HANDS_NOVICE && out->goal < 0) {
        become_novice(&p);
        p.trial->seed = seed & UINT32_MAX;
        result = try(&p, p.trial);
    }
    site_destroy(&p.site);
    free(scripts);
    return result;
}

void rehearsal_fini(struct rehearsal *rehearsal) {
    motion_fini(&rehearsal->motion);
}
