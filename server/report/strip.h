// One value beside many, as a small SVG for a line of a table: whiskers from the least to the most,
// a box between the quartiles with the median in it, a dot for each, and the one value as a mark.
// Its ink is the text's around it.
#pragma once

#include <stddef.h>
#include <stdio.h>

struct strip {
    const double *values; // finite, rising
    size_t count;         // at least 1
    double mark;          // finite
};

void strip_write(FILE *file, const struct strip *strip);

// Of rising values: what a share (0 to 1) of them is not above, on the straight line between
// neighbours.
double strip_quantile(const double *values, size_t count, double share);
