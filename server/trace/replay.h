// Runs a recorded session again, and compares every field of every step. The steps feel the
// recorded touched surfaces, which are compared with those that the match of this build finds.
#pragma once

#include "step/fields.h"
#include "trace/rerun.h"

// The largest change of a warped tip that counts as rounding of another build, libc or CPU.
#define REPLAY_TOLERANCE_MM 1e-6

enum replay_verdict {
    REPLAY_IDENTICAL,  // bit for bit; on another machine with the recorded touched surfaces
    REPLAY_EQUIVALENT, // on another machine: same states and events, within the tolerance
    REPLAY_DIFFERENT,
    REPLAY_VERDICT_COUNT
};

const char *replay_verdict_name(enum replay_verdict verdict);

struct replay_difference {
    uint64_t step;
    char field[48];
    char recorded[FIELD_TEXT_MAX], replayed[FIELD_TEXT_MAX];
};

struct replay_report {
    uint64_t steps;     // that were run and compared
    uint64_t different; // steps in which any field differs
    struct replay_difference
        first;         // if different > 0; names the hash only if no other field differs
    double largest_mm; // distance between a recorded and a replayed warped tip
    struct rerun_touches touches;
    bool same_events; // states and events agree in every step
    bool same_build, same_libc, same_cpu;
    int rules;          // of the trace's steps; the replay uses the same
    const char *digits; // what gives other last digits all the same (settings_digits); NULL: none
    int64_t session_ns; // between the first and the last step
    uint64_t taken, taken_otherwise; // jobs of the server before; that land otherwise here
    uint64_t first_otherwise;        // the first such job
    uint64_t left_out;               // steps after the first gap, whose state cannot be known
    enum result end;  // the last result of trace_read: RESULT_CLOSED for a whole file
    struct error why; // if the file is not whole
    enum replay_verdict verdict;
};

// Since the start_ns of the header.
struct replay_span {
    int64_t from_ns, to_ns;
};

// Runs all steps, and compares those in the span (NULL: all). RESULT_OK means only that the report
// is complete. RESULT_REFUSED: the case's hash is not the header's, and nothing was run. `progress`
// may be NULL; it gets the bytes read so far and the size of the file.
enum result trace_replay(struct trace_reader *reader, const struct scene *scene,
                         const struct replay_span *span,
                         void (*progress)(uint64_t done, uint64_t all),
                         struct replay_report *out_report, struct error *err);
