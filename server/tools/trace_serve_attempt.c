#include "trace_serve_attempt.h"

#include "base/clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

_Static_assert(TASK_GOALS_MAX == IGTL_GOALS_MAX && TASK_ERRORS_MAX == IGTL_ERRORS_MAX &&
                   TASK_NAME_MAX == IGTL_TASK_NAME_SIZE && TRACE_TASK_NAME_MAX == TASK_NAME_MAX,
               "all of an attempt can be told");

void served_attempt_clear(struct served_attempt *s) {
    site_destroy(&s->site);
    s->now.number = 0;
    s->told = (struct igtl_attempt_told){.figures = false};
}

static void begin_judged(struct served_attempt *s) {
    const struct task *task = &s->task;
    s->now.time_s = 0;
    s->now.goal_count = task->goal_count;
    s->now.error_count = task->error_count;
    for (int i = 0; i < task->goal_count; i++)
        memcpy(s->now.goals[i].name, task->goals[i].name, sizeof s->now.goals[i].name);
    for (int i = 0; i < task->error_count; i++)
        memcpy(s->now.errors[i].name, task->errors[i].name, sizeof s->now.errors[i].name);
}

// A task that cannot be read, or not be done on this case, is not judged.
static void prepare(struct served_attempt *s, const struct trace_attempt *begun) {
    char name[TASK_NAME_MAX + 8];
    struct error err;
    snprintf(name, sizeof name, "%s.ini", begun->task);
    if (task_parse(name, begun->text, begun->size, &s->task, &err) != RESULT_OK)
        return;
    s->now.limit_s = s->task.limit_s;
    if (s->scene && site_create(&s->task, s->scene, &s->header->settings.instruments,
                                &s->header->optic, &s->site, &err) == RESULT_OK)
        begin_judged(s);
}

void served_attempt_begin(struct served_attempt *s, const struct trace_attempt *begun) {
    served_attempt_clear(s);
    s->now = (struct igtl_attempt){
        .number = begun->number, .purpose = begun->purpose, .hand = begun->hand, .time_s = NAN};
    memcpy(s->now.task, begun->task, sizeof s->now.task);
    attempt_init(&s->attempt);
    prepare(s, begun);
}

void served_attempt_step(struct served_attempt *s, const struct trace_record *record) {
    if (!s->site || s->now.ended)
        return;
    attempt_take(&s->attempt, s->site, record->input.kind, &record->output);
    s->now.time_s = attempt_time_s(&s->attempt);
    for (int i = 0; i < s->now.goal_count; i++)
        s->now.goals[i].met = s->attempt.goals[i].met;
    for (int i = 0; i < s->now.error_count; i++)
        s->now.errors[i].count = attempt_error_count(&s->attempt, i);
}

void served_attempt_end(struct served_attempt *s, const struct trace_outcome *ended) {
    s->now.ended = true;
    s->now.end = ended->end;
    s->now.verdict = ended->verdict;
    s->now.time_s = (double)ended->time_ns / (double)NS_PER_S;
    site_destroy(&s->site);
}

bool served_attempt_next(struct served_attempt *s, int64_t utc_ns,
                         struct igtl_attempt_word *out_word) {
    return igtl_attempt_next(&s->told, &s->now, utc_ns, out_word);
}
