// Round trips counted by the microsecond, for medians and percentiles without keeping every value.
#pragma once

#include <stdint.h>

#define METER_BINS 100000 // 0 .. 100 ms; what is longer counts in the last

struct meter {
    uint32_t bins[METER_BINS];
    uint64_t count;
    int64_t max_ns;
};

void meter_clear(struct meter *meter);
void meter_add(struct meter *meter, int64_t ns);

// The smallest value that `share` (0..1) of all values do not exceed, in µs; 0 where there is none.
double meter_percentile_us(const struct meter *meter, double share);
