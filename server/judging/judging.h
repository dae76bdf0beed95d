// The attempts that a trace holds, judged again from its recorded outputs. A trace has each task's
// file, so it needs no other file but the case.
#pragma once

#include "task/attempt.h"
#include "trace/trace.h"

struct judged_attempt {
    const struct trace_attempt *begun; // as recorded; without its text
    int64_t begun_ns;                  // the session's clock: of the step before
    const struct task_file *file;      // as recorded
    const struct site *site;           // NULL: nothing was judged
    struct attempt attempt;            // at its end, or at the end of the trace
    enum verdict verdict;              // by the recorded pass mark
    const struct trace_outcome *ended; // as recorded; NULL: the trace ends, or is damaged, before
    bool is_same; // as recorded, each number of it; of one without an end: true
};

struct attempt_taker {
    void *user;
    void (*take)(void *user, const struct judged_attempt *attempt); // each, in order
    void (*progress)(uint64_t done, uint64_t all);                  // or NULL
};

// From the reader's place on; the scene is of the trace's case. Without a scene (NULL) nothing is
// judged, and each attempt is as recorded. RESULT_CLOSED: to the trace's end.
// RESULT_REFUSED: so too, but a task is none, or cannot be done on the case; its attempt is left
// out, and the error names the first. Else as trace_read.
enum result judge_trace(struct trace_reader *reader, const struct scene *scene,
                        const struct attempt_taker *taker, struct error *err);
