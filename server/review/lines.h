// The lines of a report, drawn from a trace.
#pragma once

#include "metrics/metrics.h"
#include "review/survey.h"
#include "review/thin.h"

// Of the tip, in the femur's frame, millimetres: of the mock-up as measured, and of the virtual
// femur as seen. Coronal: x and z. Sagittal: y and z.
enum tip_line {
    TIP_CORONAL_HAND,
    TIP_CORONAL_SEEN,
    TIP_SAGITTAL_HAND,
    TIP_SAGITTAL_SEEN,
    TIP_OFFSET, // this and all below over seconds
    TIP_GAIN,
    TIP_GAIN_LEAST,
    TIP_TURN,
    TIP_TILT,
    TIP_LINE_COUNT
};

// Of a tissue after each job, mm³: what is left, and where touch and sight differ.
enum tissue_line { TISSUE_VOLUME, TISSUE_TOUCHED_UNSEEN, TISSUE_SEEN_UNTOUCHED, TISSUE_LINE_COUNT };

struct report_lines {
    struct tip_lines {
        bool joined; // present at the step before
        struct thin lines[TIP_LINE_COUNT];
    } tips[INSTRUMENT_COUNT];
    // Over seconds, newtons as measured: a line breaks where nothing was measured.
    struct force_lines {
        bool joined, any;
        struct thin line;
    } forces[INSTRUMENT_COUNT];
    bool joint_joined;
    struct thin flexion, varus;
    struct tissue_lines {
        bool landed; // a job
        double last[TISSUE_LINE_COUNT];
        struct thin lines[TISSUE_LINE_COUNT];
    } tissues[TISSUES_MAX];
};

// Reads the steps from the reader's place on, whose survey is known; `metrics` were begun.
// progress: or NULL. RESULT_IO: the file cannot be read. A trace that is damaged is read as far as
// it is whole.
enum result report_lines_read(struct trace_reader *reader, const struct survey *survey,
                              survey_progress progress, struct report_lines *out_lines,
                              struct metrics *metrics, struct error *err);
