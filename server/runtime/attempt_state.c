#include "runtime/attempt_state.h"

#include <stdio.h>
#include <string.h>

_Static_assert(sizeof((arthron_AttemptState *)0)->goals / sizeof(arthron_AttemptGoal) ==
                       TASK_GOALS_MAX &&
                   sizeof((arthron_AttemptState *)0)->errors / sizeof(arthron_AttemptError) ==
                       TASK_ERRORS_MAX &&
                   sizeof((arthron_AttemptState *)0)->occurrences /
                           sizeof(arthron_AttemptOccurrence) ==
                       ATTEMPT_OCCURRENCES_MAX,
               "all of an attempt fits");
_Static_assert(sizeof((arthron_AttemptState *)0)->task == TASK_NAME_MAX &&
                   sizeof((arthron_AttemptState *)0)->title == TASK_NAME_MAX * 2 &&
                   TRACE_TASK_NAME_MAX == TASK_NAME_MAX && TRACE_TASK_MAX == TASK_FILE_MAX,
               "its names fit");
_Static_assert((int)arthron_AttemptState_End_STOPPED == ATTEMPT_STOPPED &&
                   (int)arthron_AttemptState_Verdict_NOT_YET == VERDICT_NOT_YET &&
                   (int)arthron_AttemptState_Purpose_EXAM == ATTEMPT_EXAM &&
                   (int)arthron_AttemptState_Hand_LEFT_HAND == ATTEMPT_LEFT_HAND,
               "words of the wire are those of base/attempt_words.h");

static void tell_goals(const struct task *task, const struct attempt *a,
                       arthron_AttemptState *out) {
    out->goals_count = (pb_size_t)task->goal_count;
    for (int i = 0; i < task->goal_count; i++) {
        arthron_AttemptGoal *goal = &out->goals[i];
        *goal = (arthron_AttemptGoal){.has_met_ns = a->goals[i].met, .met_ns = a->goals[i].met_ns};
        memcpy(goal->name, task->goals[i].name, sizeof goal->name);
    }
}

static void tell_errors(const struct task *task, const struct attempt *a,
                        arthron_AttemptState *out) {
    out->errors_count = (pb_size_t)task->error_count;
    for (int i = 0; i < task->error_count; i++) {
        arthron_AttemptError *error = &out->errors[i];
        *error = (arthron_AttemptError){.count = attempt_error_count(a, i),
                                        .sentinel = task->errors[i].sentinel};
        memcpy(error->name, task->errors[i].name, sizeof error->name);
    }
    out->occurrences_count = (pb_size_t)a->occurrence_count;
    for (int i = 0; i < a->occurrence_count; i++) {
        const struct occurrence *o = &a->occurrences[i];
        out->occurrences[i] = (arthron_AttemptOccurrence){
            .error = (uint32_t)o->error,
            .channel = (uint8_t)(o->tool < 0 ? 0 : CHANNEL_FIRST_INSTRUMENT + o->tool),
            .step = o->step,
            .time_ns = o->time_ns,
        };
    }
}

static enum verdict verdict_of(const struct session_attempt *attempt) {
    return attempt_verdict_by(&attempt->attempt, attempt->pass_time_s, attempt->pass_errors);
}

void attempt_state(const struct session_attempt *attempt, arthron_AttemptState *out) {
    const struct task *task = &shared_site_file(attempt->site)->task;
    const struct attempt *a = &attempt->attempt;
    *out = (arthron_AttemptState){
        .number = attempt->number,
        .version = (uint32_t)task->version,
        .purpose = (arthron_AttemptState_Purpose)attempt->purpose,
        .hand = (arthron_AttemptState_Hand)attempt->hand,
        .begun_step = a->first_step,
        .last_step = a->last_step,
        .time_ns = a->running_ns,
        .limit_s = task->limit_s,
        .end = (arthron_AttemptState_End)a->end,
        .verdict = (arthron_AttemptState_Verdict)verdict_of(attempt),
        .pass_time_s = attempt->pass_time_s,
        .pass_errors = (uint32_t)attempt->pass_errors,
        .in_order = task->in_order,
    };
    memcpy(out->task, task->name, sizeof out->task);
    memcpy(out->title, task->title, sizeof out->title);
    tell_goals(task, a, out);
    tell_errors(task, a, out);
}

void attempt_state_withhold(arthron_AttemptState *state) {
    if (state->purpose != arthron_AttemptState_Purpose_EXAM)
        return;
    state->goals_count = state->errors_count = state->occurrences_count = 0;
    state->verdict = arthron_AttemptState_Verdict_OPEN;
    state->pass_time_s = 0;
    state->pass_errors = 0;
    if (state->end == arthron_AttemptState_End_RUNS)
        return;
    state->end = arthron_AttemptState_End_ENDED;
    state->time_ns = 0;
    state->last_step = 0;
}

void attempt_begun(const struct session_attempt *attempt, struct trace_attempt *out) {
    const struct task_file *file = shared_site_file(attempt->site);
    *out = (struct trace_attempt){
        .number = attempt->number,
        .purpose = attempt->purpose,
        .hand = attempt->hand,
        .mark_version = (uint32_t)attempt->mark_version,
        .pass_time_s = attempt->pass_time_s,
        .pass_errors = (uint32_t)attempt->pass_errors,
        .size = (uint32_t)file->size,
        .text = file->text,
    };
    memcpy(out->task, file->task.name, sizeof out->task);
}

void attempt_outcome(const struct session_attempt *attempt, struct trace_outcome *out) {
    const struct attempt *a = &attempt->attempt;
    *out = (struct trace_outcome){
        .number = attempt->number,
        .end = a->end,
        .verdict = verdict_of(attempt),
        .goals_met = (uint32_t)a->goals_met,
        .errors = (uint32_t)a->errors,
        .first_step = a->first_step,
        .last_step = a->last_step,
        .time_ns = a->running_ns,
    };
}
