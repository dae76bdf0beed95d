#include "view/shown_attempt.h"

#include <math.h>
#include <string.h>

_Static_assert(
    sizeof((arthron_ViewAttempt){0}.goals) == sizeof((arthron_AttemptState){0}.goals) &&
        sizeof((arthron_ViewAttempt){0}.errors) == sizeof((arthron_AttemptState){0}.errors) &&
        sizeof((arthron_ViewAttempt){0}.task) == sizeof((arthron_AttemptState){0}.task) &&
        sizeof((arthron_ViewAttempt){0}.title) == sizeof((arthron_AttemptState){0}.title),
    "a viewer is shown what the server tells");

static int64_t good_time(int64_t time_ns) {
    return time_ns >= 0 && time_ns < WIRE_TIME_MAX_NS ? time_ns : 0;
}

void shown_attempt_take(struct shown_attempt *shown, const arthron_AttemptState *state) {
    arthron_ViewAttempt *told = &shown->told;
    *told = (arthron_ViewAttempt){
        .number = state->number,
        .purpose = state->purpose,
        .hand = state->hand,
        .time_ns = good_time(state->time_ns),
        .limit_s = state->limit_s,
        .goals_count = state->goals_count,
        .errors_count = state->errors_count,
        .end = state->end,
        .verdict = state->verdict,
        .pass_time_s = state->pass_time_s,
        .pass_errors = state->pass_errors,
        .in_order = state->in_order,
    };
    memcpy(told->task, state->task, sizeof told->task);
    memcpy(told->title, state->title, sizeof told->title);
    memcpy(told->goals, state->goals, sizeof told->goals);
    memcpy(told->errors, state->errors, sizeof told->errors);
}

void shown_attempt_go_on(struct shown_attempt *shown, int64_t now_ns, bool session_runs) {
    arthron_ViewAttempt *told = &shown->told;
    double time_ns = (double)told->time_ns + (double)(now_ns - shown->now_ns);
    if (session_runs && told->number && told->end == arthron_AttemptState_End_RUNS)
        told->time_ns = (int64_t)fmin(time_ns, fmax((double)told->time_ns, 1e9 * told->limit_s));
    shown->now_ns = now_ns;
}

void shown_attempt_put(const struct shown_attempt *shown, arthron_View *view) {
    view->has_attempt = shown->told.number != 0;
    if (view->has_attempt)
        view->attempt = shown->told;
}
