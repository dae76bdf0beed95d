// The same hands under other settings, or on another case: what would have been shown, felt and
// cut.
#pragma once

#include "trace/rerun.h"

// What one of the two, recorded or tried, gave.
struct trial_side {
    uint64_t steps;        // in which the instrument was there
    double offset_mm;      // of the shown tip from the measured one: the mean
    double noticed;        // share of its steps that might be noticed (session/discrepancy.h)
    double penetration_mm; // the largest
};

struct trial_instrument {
    struct trial_side recorded, tried;
    uint64_t both;           // steps in which it was there in both
    double mean_mm, most_mm; // between the two shown tips
};

struct trial_report {
    uint64_t steps;
    int64_t session_ns;
    struct trial_instrument instruments[INSTRUMENT_COUNT];
    uint64_t events_recorded[EVENT_COUNT], events_tried[EVENT_COUNT]; // steps with each
    int tissue_count;                                                 // of the scene
    struct tissue_figures recorded[TISSUES_MAX], tried[TISSUES_MAX];  // at the end; 0: not cut
    uint64_t left_out;                                                // steps after the first gap
    enum result end;                                                  // as of a replay
    struct error why;
};

// Any case and settings; RESULT_OK says that a report was made. `progress` as in trace_replay.
enum result trace_trial(struct trace_reader *reader, const struct scene *scene,
                        const struct session_settings *settings,
                        void (*progress)(uint64_t done, uint64_t all),
                        struct trial_report *out_report, struct error *err);
