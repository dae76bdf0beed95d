// What a pathology changed, on stdout, and whether a session can have it.
#pragma once

#include "generate/pathology.h"

// After the step was applied. RESULT_INVALID: a tear cannot be cut, or leaves more than one piece;
// a key of a torn ligament is not met by the warp (warp/adaptive.h).
enum result pathology_report(const struct knee_case *knee, const struct pathology *step,
                             struct error *err);
