// The station's certificate, for whoever looks at it from outside.
#pragma once

#include "base/result.h"

#include <stdint.h>

// From when until when (seconds since 1970) the station's certificate is good. RESULT_MISSING or
// RESULT_FORMAT name the file.
enum result link_certificate_times(const char *keys_dir, int64_t *out_from_s, int64_t *out_until_s,
                                   struct error *err);
