#include "step/job.h"

#include <stdlib.h>

const char *job_kind_name(enum job_kind kind) {
    static const char *const names[JOB_KIND_COUNT] = {"none", "cut", "restore", "undo"};
    return (unsigned)kind < JOB_KIND_COUNT ? names[kind] : "unknown";
}

const char *job_outcome_name(enum job_outcome outcome) {
    static const char *const names[JOB_OUTCOME_COUNT] = {"done", "nothing", "refused"};
    return (unsigned)outcome < JOB_OUTCOME_COUNT ? names[outcome] : "unknown";
}

void job_result_destroy(struct job_result **result) {
    if (!*result)
        return;
    cut_change_fini(&(*result)->change);
    touch_change_fini(&(*result)->touch);
    free(*result);
    *result = NULL;
}
