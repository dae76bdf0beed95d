#include "task/attempt.h"

#include "task/conditions.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define SPEED_NS 100000000LL // time constant of a tip's speed

static int64_t ns_of(double seconds) {
    return (int64_t)(seconds * 1e9);
}

void attempt_init(struct attempt *a) {
    memset(a, 0, sizeof *a);
}

bool attempt_is_same(const struct attempt *a, const struct attempt *b) {
    return memcmp(a, b, offsetof(struct attempt, hints)) == 0;
}

// ---- time and motion ----------------------------------------------------------------------------

static void pass(struct attempt *a, const struct session_output *output) {
    if (!a->first_step)
        a->first_step = output->step;
    else if (a->running)
        a->running_ns += output->time_ns - a->last_ns;
    a->last_step = output->step;
    a->running = output->state == SESSION_RUNNING;
}

static void follow(struct attempt *a, const struct session_output *output, int tool) {
    const struct instrument_output *o = &output->instruments[tool];
    int64_t passed_ns = output->time_ns - a->last_ns;
    vec3 tip = o->T_mockup_tip.translation;
    if (!o->present || !a->seen[tool])
        a->speeds[tool] = 0;
    else if (passed_ns > 0) {
        double speed = vec3_distance(tip, a->tips[tool]) / (1e-9 * (double)passed_ns);
        double share = (double)passed_ns / (double)(passed_ns + SPEED_NS);
        a->speeds[tool] += share * (speed - a->speeds[tool]);
    }
    a->seen[tool] = o->present;
    a->tips[tool] = tip;
}

static void land(struct attempt *a, const struct landed *landed) {
    if (!landed->job)
        return;
    a->resections[landed->tissue] = landed->figures.quality;
    a->cut &= ~(1u << landed->tissue);
    a->cut |= (uint32_t)(landed->figures.cuts > 0) << landed->tissue;
}

// ---- holding ------------------------------------------------------------------------------------

// True where it has held for so long.
static bool hold(struct holding *h, bool holds, int64_t now_ns, int64_t apart_ns, int64_t long_ns) {
    if (h->holds && now_ns - h->last_ns > apart_ns)
        h->holds = false;
    if (!holds)
        return false;
    if (!h->holds)
        h->since_ns = now_ns;
    h->holds = true;
    h->last_ns = now_ns;
    return now_ns - h->since_ns >= long_ns;
}

// ---- goals --------------------------------------------------------------------------------------

static void meet(struct attempt *a, int index, const struct looking *looking) {
    struct goal_state *state = &a->goals[index];
    state->met = true;
    state->met_step = a->last_step;
    state->met_ns = a->running_ns;
    a->stood = looking->T_mockup_scope.translation;
    a->goals_met++;
}

static bool stays(const struct goal *goal, const struct attempt *a, const struct looking *looking) {
    return isnan(goal->stay_mm) ||
           vec3_distance(looking->T_mockup_scope.translation, a->stood) <= goal->stay_mm;
}

// A scope that moved begins to hold anew, once it has not held for HELD_NS.
static bool is_still(const struct goal *goal, struct goal_state *state, int64_t now_ns,
                     const struct looking *looking) {
    vec3 tip = looking->T_mockup_scope.translation;
    if (isnan(goal->still_mm))
        return true;
    if (!state->hold.holds || now_ns - state->hold.last_ns > HELD_NS)
        state->from = tip;
    return vec3_distance(tip, state->from) <= goal->still_mm;
}

static bool is_met(struct attempt *a, const struct site *site, const struct session_output *output,
                   const struct looking *looking, int index) {
    const struct goal *goal = &site_task(site)->goals[index];
    struct goal_state *state = &a->goals[index];
    bool holds = goal_may_be_seen(goal, site, index, output, looking) &&
                 goal_holds_joint(goal, site, output) && stays(goal, a, looking) &&
                 goal_is_through(site, index, output, looking) &&
                 goal_resected(goal, site_goal(site, index), a) &&
                 goal_took_out(goal, site_goal(site, index), output) &&
                 goal_touches(goal, site, index, output, looking) &&
                 goal_is_seen(goal, site, index, output, looking, a);
    if (holds && goal->place_count) {
        state->along = goal_goes_along(goal, site_goal(site, index), output, state->along);
        return state->along == site_goal(site, index)->line_count;
    }
    holds = holds && is_still(goal, state, a->running_ns, looking);
    return hold(&state->hold, holds, a->running_ns, HELD_NS, ns_of(goal->hold_s));
}

// Who looks anew at where a chain of views begins, stands there: a trainee who happened to see it
// on the way is not held to that place.
static void stand_anew(struct attempt *a, const struct site *site,
                       const struct session_output *output, const struct looking *looking,
                       int index) {
    const struct goal *goals = site_task(site)->goals;
    bool is_second = index > 0 && !isnan(goals[index].stay_mm) && isnan(goals[index - 1].stay_mm);
    if (is_second && is_met(a, site, output, looking, index - 1))
        a->stood = looking->T_mockup_scope.translation;
}

static void judge_goals(struct attempt *a, const struct site *site,
                        const struct session_output *output, const struct looking *looking,
                        struct attempt_news *news) {
    const struct task *task = site_task(site);
    for (int i = 0; i < task->goal_count; i++) {
        if (a->goals[i].met)
            continue;
        stand_anew(a, site, output, looking, i);
        if (is_met(a, site, output, looking, i)) {
            meet(a, i, looking);
            news->goals_met |= 1u << i;
        }
        if (task->in_order)
            return;
    }
}

// ---- errors -------------------------------------------------------------------------------------

static void count_error(struct attempt *a, const struct site *site, int error, int tool,
                        struct attempt_news *news) {
    a->errors++;
    a->found[error][tool].count++;
    news->errors |= 1u << error;
    if (a->occurrence_count < ATTEMPT_OCCURRENCES_MAX)
        a->occurrences[a->occurrence_count++] = (struct occurrence){
            error, error_is_of_tool(site, error) ? tool : -1, a->last_step, a->running_ns};
    if (site_task(site)->errors[error].sentinel)
        a->end = ATTEMPT_SENTINEL;
}

static void judge_error(struct attempt *a, const struct site *site,
                        const struct session_output *output, const struct looking *looking,
                        int error, int tool, struct attempt_news *news) {
    const struct task_error *e = &site_task(site)->errors[error];
    struct error_state *state = &a->found[error][tool];
    bool holds = error_holds(site, error, tool, output, looking, a, state);
    bool is_long =
        hold(&state->hold, holds, a->running_ns, state->counted ? ERROR_APART_NS : HELD_NS,
             e->dropped ? 0 : ns_of(e->for_s));
    if (!state->hold.holds)
        state->counted = false;
    if (!is_long || state->counted)
        return;
    state->counted = true;
    count_error(a, site, error, tool, news);
}

// A tool that is not there makes no error, and one that it made may go on for a while.
static void judge_errors(struct attempt *a, const struct site *site,
                         const struct session_output *output, const struct looking *looking,
                         struct attempt_news *news) {
    int tools = site_tools(site)->count;
    for (int e = 0; e < site_task(site)->error_count; e++) {
        if (!error_is_of_tool(site, e)) {
            judge_error(a, site, output, looking, e, 0, news);
            continue;
        }
        for (int tool = 0; tool < tools; tool++)
            if (output->instruments[tool].present || a->found[e][tool].hold.holds)
                judge_error(a, site, output, looking, e, tool, news);
    }
}

// ---- the step -----------------------------------------------------------------------------------

static void judge(struct attempt *a, const struct site *site, const struct session_output *output,
                  struct attempt_news *news) {
    const struct task *task = site_task(site);
    struct looking looking = looking_at(site, output);
    judge_errors(a, site, output, &looking, news);
    judge_goals(a, site, output, &looking, news);
    if (a->end == ATTEMPT_RUNS && a->goals_met == task->goal_count)
        a->end = ATTEMPT_DONE;
    else if (a->end == ATTEMPT_RUNS && a->running_ns >= ns_of(task->limit_s))
        a->end = ATTEMPT_TIME_OUT;
}

struct attempt_news attempt_step(struct attempt *a, const struct site *site,
                                 const struct session_output *output) {
    struct attempt_news news = {0};
    if (a->end != ATTEMPT_RUNS)
        return news;
    pass(a, output);
    for (int tool = 0; tool < site_tools(site)->count; tool++)
        follow(a, output, tool);
    a->last_ns = output->time_ns;
    land(a, &output->landed);
    if (a->running)
        judge(a, site, output, &news);
    if (output->state == SESSION_CLOSED)
        attempt_leave(a, false);
    news.ended = a->end != ATTEMPT_RUNS;
    return news;
}

struct attempt_news attempt_take(struct attempt *a, const struct site *site, enum input_kind kind,
                                 const struct session_output *output) {
    bool leaves = kind == INPUT_RESET && a->end == ATTEMPT_RUNS;
    if (!leaves)
        return attempt_step(a, site, output);
    attempt_leave(a, false);
    return (struct attempt_news){.ended = true};
}

void attempt_pass(struct attempt *a, enum input_kind kind, int64_t time_ns,
                  const struct landed *landed) {
    if (a->end != ATTEMPT_RUNS)
        return;
    if (kind == INPUT_RESET || kind == INPUT_STOP)
        attempt_leave(a, false);
    if (a->first_step && (kind == INPUT_PAUSE || kind == INPUT_START)) {
        a->running_ns += a->running ? time_ns - a->last_ns : 0;
        a->last_ns = time_ns;
        a->running = kind == INPUT_START;
    }
    land(a, landed);
}

void attempt_leave(struct attempt *a, bool by_trainee) {
    if (a->end == ATTEMPT_RUNS)
        a->end = by_trainee ? ATTEMPT_LEFT : ATTEMPT_STOPPED;
}

void attempt_end_as(struct attempt *a, enum attempt_end recorded) {
    if (recorded == ATTEMPT_LEFT || recorded == ATTEMPT_STOPPED)
        attempt_leave(a, recorded == ATTEMPT_LEFT);
}

uint32_t attempt_error_count(const struct attempt *a, int error) {
    int32_t count = 0;
    for (int tool = 0; tool < INSTRUMENT_COUNT; tool++)
        count += a->found[error][tool].count;
    return (uint32_t)count;
}

double attempt_time_s(const struct attempt *a) {
    return 1e-9 * (double)a->running_ns;
}

enum verdict attempt_verdict_by(const struct attempt *a, double pass_time_s, int pass_errors) {
    if (a->end == ATTEMPT_RUNS)
        return VERDICT_OPEN;
    bool passed =
        a->end == ATTEMPT_DONE && attempt_time_s(a) <= pass_time_s && a->errors <= pass_errors;
    return passed ? VERDICT_PASSED : VERDICT_NOT_YET;
}

enum verdict attempt_verdict(const struct attempt *a, const struct task *task) {
    return attempt_verdict_by(a, task->pass_time_s, task->pass_errors);
}
