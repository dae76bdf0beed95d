#include "loop/meter.h"

#include <string.h>

void meter_clear(struct meter *meter) {
    memset(meter, 0, sizeof *meter);
}

void meter_add(struct meter *meter, int64_t ns) {
    int64_t bin = ns < 0 ? 0 : ns / 1000;
    meter->bins[bin < METER_BINS ? bin : METER_BINS - 1]++;
    meter->count++;
    if (ns > meter->max_ns)
        meter->max_ns = ns;
}

double meter_percentile_us(const struct meter *meter, double share) {
    uint64_t seen = 0;
    for (int i = 0; i < METER_BINS; i++) {
        seen += meter->bins[i];
        if (seen && (double)seen >= share * (double)meter->count)
            return i + 1;
    }
    return 0;
}
