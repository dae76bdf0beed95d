// Numbers and switches from text that a person wrote. The whole text has to be one.
#pragma once

#include "base/pose.h"

#include <stdbool.h>
#include <stdint.h>

// Decimal, within [low, high]; false leaves *out as it was.
bool number_int(const char *text, int64_t low, int64_t high, int64_t *out);
bool number_double(const char *text, double low, double high, double *out);

// yes, true, on, 1; no, false, off, 0.
bool number_bool(const char *text, bool *out);

// Up to `most` finite numbers, separated by blanks or commas: their count, or -1 where there are
// more or something is none.
int number_list(const char *text, int most, double *out);

// "x y z qw qx qy qz" in mm, or "x y z" alone for no rotation; separated by blanks or commas. The
// rotation is brought to unit length; false where its length is not within 1e-3 of 1.
bool number_pose(const char *text, pose *out);
