// How hard something is pressed, and how much of the time that was measured.
//
// Forces count without their sign. A force stands from the step that tells it until the next step.
// A step that does not tell it repeats it as held, for up to FORCE_HOLD_NS; then it is lost. Only
// what was measured (VALIDITY_OK) makes a mean and a peak: a held force may be that of another
// touch.
#pragma once

#include "base/sample.h"

#define FORCE_HOLD_NS 100000000LL

// What a gauge says now.
struct gauge {
    bool known; // it has told something
    enum validity validity;
    double force_n;
    int64_t told_ns; // the step that told it
};

struct force_figures {
    int64_t in_ns[VALIDITY_COUNT]; // time in each validity
    double sum_n_ns, peak_n;       // of VALIDITY_OK
};

// told: the newest sample of the step's frame; NULL: none.
void gauge_step(struct gauge *gauge, const struct sample *told, int64_t time_ns);

// Counts the gauge's force for passed_ns, the time until the next step.
void force_pass(struct force_figures *figures, const struct gauge *gauge, int64_t passed_ns);

int64_t force_time_ns(const struct force_figures *figures); // in any validity
double force_mean_n(const struct force_figures *figures);   // NaN: nothing was measured
double force_peak_n(const struct force_figures *figures);   // too
