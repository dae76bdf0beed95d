// Runs the recorded hands under other settings or on another case, and compares what they would
// have shown, touched and cut.
#pragma once

#include "trace/rerun.h"

// Figures of the recorded session or of the tried one.
struct trial_side {
    uint64_t steps;        // with the instrument present
    double offset_mm;      // mean distance of the shown tip from the measured one
    double noticed;        // share of these steps past a threshold of step/discrepancy.h
    double penetration_mm; // the largest
};

struct trial_instrument {
    struct trial_side recorded, tried;
    uint64_t both;           // steps with the instrument present in both
    double mean_mm, most_mm; // distance between the two shown tips
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
