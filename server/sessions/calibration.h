// Whether a station's calibration is still good enough.
#pragma once

#include "sessions/config.h"
#include "wire/wire.h"

// A sentence for people where the calibration is older or worse than the config allows, or dated in
// the future; empty where it is good. At most 127 bytes.
void calibration_judge(const arthron_Calibration *calibration, const struct sessions_config *config,
                       int64_t now_utc_s, char *out_text, size_t size);
