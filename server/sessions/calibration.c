#include "sessions/calibration.h"

#include <inttypes.h>
#include <stdio.h>

#define DAY_S 86400

void calibration_judge(const arthron_Calibration *c, const struct sessions_config *config,
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
