// Attempts as rows of the records: of one that ends in its session, and of all that a trace holds.
// Both give the same row.
#pragma once

#include "records/recorder.h"
#include "runtime/types.h"
#include "trace/trace.h"

// Of one that has ended. start_utc_ns: of its session.
void attempt_row_of(const struct session_attempt *attempt, const char session[STORE_ID_MAX],
                    int64_t start_utc_ns, struct attempt_row *out);

// As of recorder_config.read_attempts: each attempt with a recorded end, in order. One whose task
// this program refuses is told in the log and left out; so are figures and occurrences where they
// cannot be judged, or come out otherwise than recorded.
void attempt_rows_read(const char *trace, const struct scene *scene, attempt_row_taker take,
                       void *user);
