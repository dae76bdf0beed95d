#include "hub/calibration.h"

#include <inttypes.h>
#include <stdio.h>

#define DAY_S 86400

void calibration_judge(const arthron_Calibration *c, const struct hub_config *config,
                       int64_t now_utc_s, char *out_text, size_t size) {
    int64_t days = (now_utc_s - c->utc_s) / DAY_S;
    out_text[0] = '\0';
    if (c->utc_s > now_utc_s + DAY_S)
        snprintf(out_text, size, "its calibration is of a day to come");
    else if (days > config->calibration_days)
        snprintf(out_text, size, "its calibration is %" PRId64 " days old, more than %d", days,
                 config->calibration_days);
    else if (c->residual_mm > config->calibration_mm)
        snprintf(out_text, size, "its calibration has a residual of %.3g mm, more than %g",
                 c->residual_mm, config->calibration_mm);
    else if (c->residual_deg > config->calibration_deg)
        snprintf(out_text, size, "its calibration has a residual of %.3g degrees, more than %g",
                 c->residual_deg, config->calibration_deg);
}

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
