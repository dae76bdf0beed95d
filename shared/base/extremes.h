// As fmin and fmax of numbers, without a call.
#pragma once

static inline double lower(double a, double b) {
    return a < b ? a : b;
}

static inline double higher(double a, double b) {
    return a > b ? a : b;
}
