#include "rehearsal/rehearsal.h"

#include "base/check.h"
#include "rehearsal/planner.h"
#include "rehearsal/take.h"
#include "rehearsal/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SETTLE_S 0.4        // that hands rest longer than a goal asks
#define SPARE_OF_SHARES 0.9 // of what a plan allows to be left, or to be gone beyond it

// In the order in which they are tried: each opens another place.
static const struct stance stances[] = {
    {20, 0, 0}, {20, 8, 0},  {20, -8, 0},  {45, 0, 0},  {70, 0, 0},  {90, 0, 0},  {90, -8, 0},
    {5, 0, 0},  {20, 8, 12}, {20, -8, 12}, {20, 8, 26}, {90, 0, 26}, {90, -8, 26}};
#define STANCE_COUNT ((int)(sizeof stances / sizeof *stances))

// ---- a goal as steps ----------------------------------------------------------------------------

static const char *group_name(const struct planner *p, const struct spot *spot) {
    return p->knee->groups[spot->group].name;
}

static enum channel channel_of(const struct site_goal *g) {
    return (enum channel)(CHANNEL_FIRST_INSTRUMENT + g->tool);
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

static void look_at(const struct planner *p, const struct spot *spot, const char *landmark,
                    double distance) {
    struct motion_step *step =
        add_place(p->script, MOTION_LOOK, CHANNEL_SCOPE, group_name(p, spot), landmark, "");
    if (step)
        step->amount = distance;
}

// From where the judge sees it.
static bool look_by_judge(struct planner *p, int index, double distance) {
    const struct spot *spot = &site_goal(p->site, index)->see;
    struct view view;
    if (!find_view(p, index, distance, &view))
        return false;
    struct motion_step *step =
        add_named(p->script, MOTION_LOOK, CHANNEL_SCOPE, group_name(p, spot));
    if (!step)
        return false;
    step->has_place = step->is_free = true;
    step->from.at = pose_apply_inverse(plan_body_pose(&p->plan, spot->body), view.tip);
    step->roll_deg = view.roll_deg;
    return true;
}

// The joint is held already.
static bool look(struct planner *p, int index, double distance) {
    const struct goal *goal = &p->task->goals[index];
    const struct site_goal *g = site_goal(p->site, index);
    if (goal->see[0])
        return look_by_judge(p, index, distance);
    if (goal->touch[0])
        look_at(p, &g->touch, goal->touch, distance);
    else if (goal->place_count)
        look_at(p, &g->touch, goal->follow[0], distance);
    return true;
}

// The next goal wants the scope to stay and its optic to turn.
static bool is_turned_from(const struct planner *p, int index) {
    return index + 1 < p->task->goal_count && !isnan(p->task->goals[index + 1].stay_mm);
}

// From one stand to all places of a chain of goals.
static void turn_to(const struct planner *p, struct motion_script *script, int index) {
    const struct goal *goals = p->task->goals;
    const char *group = group_name(p, &site_goal(p->site, index)->see);
    if (isnan(goals[index].stay_mm))
        add_place(script, MOTION_STAND, CHANNEL_SCOPE, group, goals[index].see,
                  goals[index + 1].see);
    add_place(script, MOTION_TURN, CHANNEL_SCOPE, group, goals[index].see, "");
}

static bool needs_tool(const struct goal *goal) {
    return goal->touch[0] || goal->place_count;
}

// The scope looks first: a tool that waits inside is out of its picture.
static void bring_in(struct planner *p, enum channel tool) {
    if (!plan_hand(&p->plan, tool)->inside)
        add_named(p->script, MOTION_APPROACH, tool, p->portals[1]);
}

// ---- trying -------------------------------------------------------------------------------------

static void play_anew(struct planner *p) {
    play_destroy(&p->play);
    p->play = play_create(p->script->rate_hz, p->scene, p->site, NULL);
    play_on(p->play, p->plan.motion);
}

static bool palpate_from(struct planner *p, int index, vec3 at) {
    const struct goal *goal = &p->task->goals[index];
    const struct site_goal *g = site_goal(p->site, index);
    int first = p->script->step_count;
    struct motion_step *step =
        add_place(p->script, MOTION_PALPATE, channel_of(g), group_name(p, &g->touch), "",
                  goal->follow[goal->place_count - 1]);
    if (!step)
        return false;
    step->from.at = place_of(p->knee, at);
    return plan_from(p, first);
}

// A line can leap where it is nearest to another face of its surface: the hand lifts off there and
// goes on from the first point that it has not passed.
static bool trace_on(struct planner *p, int index) {
    const struct site_goal *g = site_goal(p->site, index);
    const struct goal_state *state = &play_attempt(p->play)->goals[index];
    int32_t before = 0;
    play_on(p->play, p->plan.motion);
    while (!state->met && state->along > before) {
        before = state->along;
        if (!palpate_from(p, index, g->line[before]))
            return false;
        play_on(p->play, p->plan.motion);
    }
    if (!state->met)
        fail(p->err, RESULT_INVALID, "%d of %d points of the line are passed, and no more",
             state->along, g->line_count);
    return state->met;
}

// Goals that are pursued together: those whose scope stays.
static int last_of_chain(const struct planner *p, int goal) {
    while (is_turned_from(p, goal))
        goal++;
    return goal;
}

// Plans the goal's steps; false where one is refused.
static bool pursue(struct planner *p, int index, const struct stance *stance) {
    struct motion_script *script = p->script;
    const struct goal *goal = &p->task->goals[index];
    const struct site_goal *g = site_goal(p->site, index);
    int first = script->step_count;
    bool turns = !isnan(goal->stay_mm);
    if (!turns) {
        take_out_tools(p);
        hold_joint(p, goal, stance);
    }
    if (!plan_from(p, first))
        return false;
    first = script->step_count;
    if (turns || is_turned_from(p, index))
        turn_to(p, script, index);
    else if (!look(p, index, stance->distance))
        return false;
    if (needs_tool(goal)) {
        bring_in(p, channel_of(g));
        touch(p, script, goal, g);
    }
    if (!plan_from(p, first) || (goal->place_count && !trace_on(p, index)) ||
        (goal->take_out[0] && !take_out(p, g->loose, stance->distance)))
        return false;
    first = script->step_count;
    add_amount(script, MOTION_WAIT, goal->hold_s + SETTLE_S);
    return plan_from(p, first);
}

// Plans and plays the goals of a chain. Whether they are met.
static bool play_chain(struct planner *p, int goal, int last, const struct stance *stance) {
    for (int i = goal; i <= last; i++)
        if (!pursue(p, i, stance))
            return false;
    play_on(p->play, p->plan.motion);
    if (!play_attempt(p->play)->goals[last].met)
        fail(p->err, RESULT_INVALID,
             "the hands get there, but its conditions do not hold together");
    return play_attempt(p->play)->goals[last].met;
}

// Where the stance does not meet the goal, all is as before. An error counts as not met, but
// *flawed becomes the first stance that made one; NULL: errors are taken.
static bool try_stance(struct planner *p, int goal, const struct stance *stance,
                       const struct stance **flawed) {
    int first_step = p->script->step_count, errors = play_attempt(p->play)->errors;
    struct plan_mark before = plan_mark(&p->plan);
    bool met = play_chain(p, goal, last_of_chain(p, goal), stance);
    bool is_flawed = flawed && play_attempt(p->play)->errors > errors;
    if (met && !is_flawed)
        return true;
    if (met && !*flawed)
        *flawed = stance;
    p->script->step_count = first_step;
    plan_back(&p->plan, &before);
    if (play_rows(p->play) > p->plan.motion->row_count)
        play_anew(p);
    return false;
}

// The expert tries stances until one meets the goal without an error, first the one that the joint
// has.
static bool meet(struct planner *p, int goal) {
    const struct stance now = {p->plan.hold.flexion_deg, p->plan.hold.valgus_deg, 0};
    const struct stance *flawed = NULL;
    struct error first = {""};
    if (p->task->goals[goal].resect[0])
        return meet_resection(p, goal);
    if (goal > 0 && try_stance(p, goal, &now, &flawed))
        return true;
    for (int i = 0; i < STANCE_COUNT; i++) {
        if (try_stance(p, goal, &stances[i], &flawed))
            return true;
        if (i == 0)
            first = *p->err;
    }
    if (flawed && try_stance(p, goal, flawed, NULL))
        return true;
    *p->err = first;
    fail_in(p->err, RESULT_INVALID, "[goal %s]: ", p->task->goals[goal].name);
    return false;
}

// ---- the whole ----------------------------------------------------------------------------------

// CHANNEL_SCOPE: no other.
static enum channel tool_of(const struct planner *p, int goal) {
    const struct goal *g = &p->task->goals[goal];
    if (g->resect[0])
        return CHANNEL_PUNCH;
    if (g->take_out[0])
        return CHANNEL_FIRST_DESCRIBED;
    return needs_tool(g) ? channel_of(site_goal(p->site, goal)) : CHANNEL_SCOPE;
}

static bool take_up(struct planner *p) {
    if (plan_begin(&p->plan) != RESULT_OK ||
        plan_take_up(&p->plan, CHANNEL_SCOPE, p->portals[0]) != RESULT_OK)
        return false;
    for (int i = 0; i < p->task->goal_count; i++) {
        enum channel tool = tool_of(p, i);
        if (tool != CHANNEL_SCOPE && plan_take_up(&p->plan, tool, p->portals[1]) != RESULT_OK)
            return false;
    }
    return plan_add_row(&p->plan, NULL) == RESULT_OK;
}

static bool enter(struct planner *p) {
    add_named(p->script, MOTION_APPROACH, CHANNEL_SCOPE, p->portals[0]);
    return plan_from(p, 0);
}

static bool begin(struct planner *p, struct motion *motion) {
    *p->script = (struct motion_script){.rate_hz = 100,
                                        .speed_mm_s = 40,
                                        .joint_speed_deg_s = 30,
                                        .tremor_mm = 0.05,
                                        .seed = 1,
                                        .optic_deg = site_optic(p->site)->tilt_deg};
    p->plan = (struct plan){.knee = p->knee, .script = p->script, .motion = motion, .err = p->err};
    if (!take_up(p) || !enter(p))
        return false;
    play_anew(p);
    return true;
}

static int meet_all(struct planner *p, void (*progress)(int, int)) {
    for (int i = 0; i < p->task->goal_count; i++) {
        if (!meet(p, i))
            return i;
        i = last_of_chain(p, i);
        if (progress)
            progress(i + 1, p->task->goal_count);
    }
    return p->task->goal_count;
}

// How many goals were met.
static int pursue_all(struct planner *p, const char *scope, const char *other,
                      void (*progress)(int, int), struct rehearsal *out) {
    *out = (struct rehearsal){.script = alloc(1, sizeof *p->script)};
    p->script = out->script;
    p->portals[0] = scope;
    p->portals[1] = other;
    int met = begin(p, &out->motion) ? meet_all(p, progress) : 0;
    out->goal = met == p->task->goal_count ? -1 : met;
    if (p->play)
        out->attempt = *play_attempt(p->play);
    attempt_leave(&out->attempt, true);
    play_destroy(&p->play);
    plan_end(&p->plan);
    return met;
}

// Either hand on the scope: the one that gets farther.
static void try_both_hands(struct planner *p, void (*progress)(int, int), struct rehearsal *out) {
    const struct case_portal *portals = p->knee->portals;
    int met = pursue_all(p, portals[0].name, portals[1].name, progress, out);
    if (met == p->task->goal_count)
        return;
    struct error why = *p->err;
    struct rehearsal first = *out;
    if (pursue_all(p, portals[1].name, portals[0].name, progress, out) > met) {
        rehearsal_fini(&first);
        return;
    }
    rehearsal_fini(out);
    *out = first;
    *p->err = why;
}

static enum result prepare(struct knee_case *knee, struct error *err) {
    enum result result = motion_prepare(knee, knee->landmark_count == 0, err);
    if (result == RESULT_OK && knee->portal_count < 2)
        result = fail(err, RESULT_MISSING, "the case has one portal; a task needs two");
    return result;
}

static enum result make_site(const struct task *task, const struct scene *scene,
                             struct site **out_site, struct error *err) {
    struct view_optic optic = task_optic(task);
    return site_create(task, scene, instruments_of_hands(), &optic, out_site, err);
}

static enum result perform(const struct task *task, struct knee_case *knee,
                           const struct scene *scene, void (*progress)(int done, int all),
                           struct rehearsal *out, struct error *err) {
    struct planner p = {.task = task, .knee = knee, .scene = scene, .err = err};
    *out = (struct rehearsal){.goal = -1};
    enum result result = make_site(task, scene, &p.site, err);
    if (result == RESULT_OK)
        try_both_hands(&p, progress, out);
    site_destroy(&p.site);
    return result;
}

// The task with bounds that leave room for a tracker's noise. Whether it differs.
static bool with_spare(struct task *task) {
    bool differs = false;
    for (int i = 0; i < task->goal_count; i++) {
        struct goal *goal = &task->goals[i];
        goal->under_share *= SPARE_OF_SHARES;
        goal->over_share *= SPARE_OF_SHARES;
        differs |= goal->resect[0] != 0;
    }
    return differs;
}

static enum result judge(const struct task *task, const struct scene *scene, struct rehearsal *out,
                         struct error *err) {
    struct site *site;
    enum result result = make_site(task, scene, &site, err);
    if (result != RESULT_OK)
        return result;
    play_motion(&out->motion, out->script->rate_hz, scene, site, NULL, &out->attempt);
    site_destroy(&site);
    return RESULT_OK;
}

// Where the hands cannot keep room, they do what the task asks and no more.
static enum result perform_with_spare(const struct task *task, const struct task *careful,
                                      struct knee_case *knee, const struct scene *scene,
                                      void (*progress)(int done, int all), struct rehearsal *out,
                                      struct error *err) {
    enum result result = perform(careful, knee, scene, progress, out, err);
    if (result != RESULT_OK)
        return result;
    if (out->goal < 0)
        return judge(task, scene, out, err);
    rehearsal_fini(out);
    return perform(task, knee, scene, progress, out, err);
}

static enum result rehearse_expert(const struct task *task, struct knee_case *knee,
                                   const struct scene *scene, void (*progress)(int done, int all),
                                   struct rehearsal *out, struct error *err) {
    *out = (struct rehearsal){.goal = -1};
    enum result result = prepare(knee, err);
    if (result != RESULT_OK)
        return result;
    struct task *careful = alloc(1, sizeof *careful);
    *careful = *task;
    if (with_spare(careful))
        result = perform_with_spare(task, careful, knee, scene, progress, out, err);
    else
        result = perform(task, knee, scene, progress, out, err);
    free(careful);
    return result;
}

enum result rehearse_novice(const struct task *task, struct knee_case *knee,
                            const struct scene *scene, const struct rehearsal *expert, int64_t seed,
                            struct rehearsal *out, struct error *err) {
    *out = (struct rehearsal){.goal = -1, .script = alloc(1, sizeof *out->script)};
    become_novice(expert->script, knee, seed, out->script);
    enum result result = motion_plan(knee, out->script, &out->motion, err);
    return result == RESULT_OK ? judge(task, scene, out, err) : result;
}

enum result rehearse(const struct task *task, struct knee_case *knee, const struct scene *scene,
                     enum rehearsal_hands hands, int64_t seed, void (*progress)(int done, int all),
                     struct rehearsal *out, struct error *err) {
    enum result result = rehearse_expert(task, knee, scene, progress, out, err);
    if (result != RESULT_OK || hands == HANDS_EXPERT || out->goal >= 0)
        return result;
    struct rehearsal expert = *out;
    result = rehearse_novice(task, knee, scene, &expert, seed, out, err);
    rehearsal_fini(&expert);
    return result;
}

enum result rehearsal_load(const char *dir, struct knee_case **out_knee, struct scene **out_scene,
                           struct error *err) {
    struct knee_case *second = NULL;
    *out_scene = NULL;
    enum result result = case_load(dir, NULL, out_knee, err);
    if (result == RESULT_OK)
        result = case_load(dir, NULL, &second, err);
    if (result == RESULT_OK)
        result = scene_create(&second, out_scene, err);
    case_destroy(&second);
    return result;
}

void rehearsal_fini(struct rehearsal *rehearsal) {
    motion_fini(&rehearsal->motion);
    free(rehearsal->script);
    rehearsal->script = NULL;
}
