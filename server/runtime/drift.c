#include "runtime/drift.h"

static bool end_touch(struct drift *d) {
    double residual_mm = d->sum_mm / d->steps;
    d->touches++;
    uint64_t weight = d->touches < DRIFT_TOUCHES ? d->touches : DRIFT_TOUCHES;
    d->mean_mm += (residual_mm - d->mean_mm) / (double)weight;
    d->steps = 0;
    d->sum_mm = 0;
    return true;
}

bool drift_step(struct drift *d, bool closed, double distance_mm) {
    if (!closed)
        return d->steps ? end_touch(d) : false;
    if (distance_mm >= 0) {
        d->steps++;
        d->sum_mm += distance_mm;
    }
    return false;
}
