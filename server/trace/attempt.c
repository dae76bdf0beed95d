#include "case/case.h"
#include "trace/record.h"

#include <string.h>

bool trace_attempt_is_valid(const struct trace_attempt *a) {
    return a->number > 0 && a->number <= TRACE_ATTEMPTS_MAX &&
           (unsigned)a->purpose < ATTEMPT_PURPOSE_COUNT && (unsigned)a->hand < ATTEMPT_HAND_COUNT &&
           case_name_is_valid(a->task) && a->pass_time_s >= 1 && a->pass_time_s <= 3600 &&
           a->pass_errors <= 1000 && a->size > 0 && a->size <= TRACE_TASK_MAX && a->text;
}

bool trace_outcome_is_valid(const struct trace_outcome *o) {
    return o->number > 0 && o->number <= TRACE_ATTEMPTS_MAX && o->end > ATTEMPT_RUNS &&
           (unsigned)o->end < ATTEMPT_END_COUNT && o->verdict > VERDICT_OPEN &&
           (unsigned)o->verdict < VERDICT_COUNT && o->time_ns >= 0 && time_is_sane(o->time_ns) &&
           o->first_step <= o->last_step;
}
