// The attempt of a recorded session that is served, judged again step by step, as OpenIGTLink tells
// it (igtl/attempt.h).
#pragma once

#include "igtl/attempt.h"
#include "task/attempt.h"
#include "trace/trace.h"

struct served_attempt {
    const struct scene *scene; // NULL: it is told without goals and errors
    const struct trace_header *header;
    struct task task;
    struct site *site; // NULL: it is not judged
    struct attempt attempt;
    struct igtl_attempt now;
    struct igtl_attempt_told told;
};

// A zeroed one with scene and header has none. Forgets the one before.
void served_attempt_clear(struct served_attempt *served);

void served_attempt_begin(struct served_attempt *served, const struct trace_attempt *begun);
void served_attempt_step(struct served_attempt *served, const struct trace_record *record);
void served_attempt_end(struct served_attempt *served, const struct trace_outcome *ended);

bool served_attempt_next(struct served_attempt *served, int64_t utc_ns,
                         struct igtl_attempt_word *out_word);
