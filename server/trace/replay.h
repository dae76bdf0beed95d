// Runs a recorded session again, and compares every field of every step.
#pragma once

#include "step/fields.h"
#include "trace/rerun.h"

// What other mathematics (another build, libc or CPU) may move a warped pose by.
#define REPLAY_TOLERANCE_MM 1e-6

enum replay_verdict {
    REPLAY_IDENTICAL,  // bit for bit
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
    uint64_t steps;                 // run and compared
    uint64_t different;             // steps in which any field differs
    struct replay_difference first; // where different > 0; the hash only where nothing else differs
    double largest_mm;              // between a recorded and a replayed warped tip
    bool same_events;               // states and events of every step
    bool same_build, same_libc, same_cpu;
    int rules;          // that its steps follow, recorded and replayed
    int64_t session_ns; // between the first and the last step
    uint64_t left_out;  // steps after the first gap: their inputs' past is not known
    enum result end;    // how reading ended: RESULT_CLOSED for a whole file
    struct error why;   // where it did not
    enum replay_verdict verdict;
};

// Since the start_ns of the header.
struct replay_span {
    int64_t from_ns, to_ns;
};

// The case's hash must be that of the header: else RESULT_REFUSED and nothing is run. RESULT_OK
// says only that a report was made. All steps are run, and those of the span compared (NULL: all
// that are there). `progress` may be NULL; it gets bytes read and bytes in all.
enum result trace_replay(struct trace_reader *reader, const struct scene *scene,
                         const struct replay_span *span,
                         void (*progress)(uint64_t done, uint64_t all),
                         struct replay_report *out_report, struct error *err);
