// A cubic polynomial, and where it first comes down to 0.
#pragma once

#include <stdbool.h>

struct cubic {
    double c[4]; // c[0] + c[1] s + c[2] s² + c[3] s³
};

double cubic_at(const struct cubic *p, double s);

// True: *out_s is the smallest s in [low, high] with p(s) <= 0, to rounding or to |p| <= tolerance.
// False: there is none, and *out_s is where p is least. Adds to *steps what Newton and bisection
// took.
bool cubic_descend(const struct cubic *p, double low, double high, double tolerance, double *out_s,
                   int *steps);
