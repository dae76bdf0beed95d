// What the drivers share of a force: it is one number, or the length of a vector of three.
#pragma once

#include "base/result.h"
#include "drivers/device.h"

#include <stdbool.h>

#define FORCE_PARTS_MAX 3
#define FORCE_TEXT_MAX 128

// The parts of "A" or "A, B, C", without blanks around them. Returns how many; 0: it is neither, or
// a part is empty or longer than FORCE_TEXT_MAX - 1 bytes.
int force_split(const char *text, char out_parts[FORCE_PARTS_MAX][FORCE_TEXT_MAX]);

struct force {
    int count;                      // of its parts: 1 or 3
    double zero_n[FORCE_PARTS_MAX]; // what they are with nothing pressing
};

// `force` has its count; reads zero.CHANNEL: as many numbers in newtons, 0 where it is absent.
enum result force_read_zero(const struct device_config *config, enum channel channel,
                            struct force *force, struct error *err);

// NaN where a part is none.
double force_of(const struct force *force, const double parts_n[FORCE_PARTS_MAX]);
