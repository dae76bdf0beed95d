#include "samples.h"

#include "base/check.h"

#include <math.h>
#include <stdlib.h>
#include <time.h>

void samples_add(struct samples *samples, double value) {
    if (samples->count == samples->capacity) {
        samples->capacity = samples->capacity ? 2 * samples->capacity : 1024;
        samples->values = alloc_resize(samples->values, samples->capacity, sizeof(double));
    }
    samples->values[samples->count++] = value;
}

void samples_fini(struct samples *samples) {
    free(samples->values);
    *samples = (struct samples){0};
}

double samples_mean(const struct samples *samples) {
    double sum = 0;
    for (size_t i = 0; i < samples->count; i++)
        sum += samples->values[i];
    return samples->count ? sum / (double)samples->count : NAN;
}

double samples_max(const struct samples *samples) {
    double largest = samples->count ? samples->values[0] : NAN;
    for (size_t i = 1; i < samples->count; i++)
        largest = fmax(largest, samples->values[i]);
    return largest;
}

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

double samples_quantile(struct samples *samples, double share) {
    if (!samples->count)
        return NAN;
    qsort(samples->values, samples->count, sizeof(double), compare);
    return samples->values[(size_t)(share * (double)(samples->count - 1))];
}

double samples_own_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

#define READINGS 1001

static double reading_us(void) {
    struct samples us = {0};
    for (int i = 0; i < READINGS; i++) {
        double before = samples_own_us();
        samples_add(&us, samples_own_us() - before);
    }
    double median = samples_quantile(&us, 0.5);
    samples_fini(&us);
    return median;
}

void samples_add_own(struct samples *samples, double before_us) {
    static double reading;
    double took = samples_own_us() - before_us;
    if (!reading)
        reading = reading_us();
    samples_add(samples, fmax(took - reading, 0));
}
