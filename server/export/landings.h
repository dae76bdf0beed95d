// The cuts of a record as they took effect: its jobs are run again beside it.
#pragma once

#include "export/contents.h"

struct landing {
    uint64_t step;
    double seconds;
    enum job_kind kind;
    bool wanted;      // within the time asked for, else before it
    bool as_recorded; // it gave what the record says that it gave
    struct job_result *result;
};

struct landing_watcher {
    void *context;
    // Before the first step: what a piece of a record begins with.
    void (*start)(void *context, const struct operation *operation);
    // Each job that changed a tissue, in order, and the operation right after it. Who keeps the
    // result sets landing->result to NULL.
    void (*landed)(void *context, struct landing *landing, const struct operation *operation);
};

// One pass of the walk over all up to the end of the time asked for. The request has a scene.
// RESULT_REFUSED where it is of another case than the record, RESULT_FORMAT where a job cannot be
// run.
enum result landings_run(struct walk *walk, const struct landing_watcher *watcher,
                         struct error *err);
