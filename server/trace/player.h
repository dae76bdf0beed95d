// Goes through a trace, and calls back for what it meets.
#pragma once

#include "trace/trace.h"

// Each may be NULL: what it would be told of is passed over. False ends the pass.
struct trace_player {
    void *user;
    bool (*record)(void *user, const struct trace_record *record); // any, before its own
    bool (*step)(void *user, const struct trace_record *record);   // TRACE_STEP
    bool (*past)(void *user, const struct trace_record *record);   // TRACE_PAST
    bool (*gap)(void *user, uint64_t missing);
    bool (*resume)(void *user, int64_t utc_ns);
    bool (*fault)(void *user, int64_t utc_ns);
    bool (*remark)(void *user, const struct remark *remark);
    bool (*end)(void *user, uint64_t records, uint64_t missing);
    void (*progress)(uint64_t done, uint64_t all); // bytes, after each record
};

// From where the reader is. RESULT_OK where a callback ended the pass, else as trace_read:
// RESULT_CLOSED behind the end record, and what is wrong with the trace where it stops before.
enum result trace_play(struct trace_reader *reader, const struct trace_player *player,
                       struct error *err);
