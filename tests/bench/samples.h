// Samples of one figure, and their order statistics.
#pragma once

#include <stddef.h>

// Zero-initialise; release with samples_fini.
struct samples {
    double *values;
    size_t count, capacity;
};

void samples_add(struct samples *samples, double value);
void samples_fini(struct samples *samples);

double samples_mean(const struct samples *samples); // NaN where there is none, as the next ones
double samples_max(const struct samples *samples);

// The share-th value from below, 0.5 the median. Sorts the samples.
double samples_quantile(struct samples *samples, double share);

// The processor time of this thread so far, in µs: a busy machine interrupts what is measured.
double samples_own_us(void);

// Adds what has passed of it since `before_us`, less what reading the clock takes: up to a µs, where
// it is a call into the kernel.
void samples_add_own(struct samples *samples, double before_us);
