// Reads a trace and calls a function for each record, by its type.
#pragma once

#include "trace/trace.h"

// A function that is NULL is not called. A function that returns false ends the pass.
struct trace_player {
    void *user;
    bool (*record)(void *user, const struct trace_record *record); // every record, before its own
    bool (*step)(void *user, const struct trace_record *record);   // TRACE_STEP
    bool (*past)(void *user, const struct trace_record *record);   // TRACE_PAST
    bool (*taken)(void *user, const struct trace_record *record);  // TRACE_TAKEN
    // The whole state with which a later part begins, once.
    bool (*state)(void *user, const struct trace_state *state);
    bool (*gap)(void *user, uint64_t missing);
    bool (*resume)(void *user, int64_t utc_ns);
    bool (*fault)(void *user, int64_t utc_ns);
    bool (*remark)(void *user, const struct remark *remark);
    bool (*marker)(void *user, const struct marker *marker);
    bool (*begun)(void *user, const struct trace_attempt *attempt);
    bool (*ended)(void *user, const struct trace_outcome *outcome);
    bool (*end)(void *user, uint64_t records, uint64_t missing);
    void (*progress)(uint64_t done, uint64_t all); // bytes, after each record
};

// Begins at the reader's place. RESULT_OK: a function ended the pass. Otherwise the last result of
// trace_read: RESULT_CLOSED after the end record, or the fault of the trace.
enum result trace_play(struct trace_reader *reader, const struct trace_player *player,
                       struct error *err);
