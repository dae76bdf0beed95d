// Values over flexion: a monotone cubic through knots, component by component (Fritsch, Carlson,
// SIAM J. Numer. Anal. 17, 1980). Between two knots each component stays between their values.
// Constant past the outer knots, where the slope is 0: continuously differentiable everywhere.
#pragma once

#include <stdbool.h>

#define CURVE_COMPONENTS 6
#define CURVE_KNOTS_MAX 32

struct curve {
    int count;
    double at[CURVE_KNOTS_MAX]; // rising
    double value[CURVE_KNOTS_MAX][CURVE_COMPONENTS];
    double slope[CURVE_KNOTS_MAX][CURVE_COMPONENTS];
};

// Knots in any order, into a curve that was all 0; then curve_finish. Adds nothing and gives false
// where another knot lies nearer than `gap`. At most CURVE_KNOTS_MAX.
bool curve_add(struct curve *curve, double at, double gap, const double value[CURVE_COMPONENTS]);
void curve_finish(struct curve *curve);

// 0 for a curve without knots.
void curve_at(const struct curve *curve, double at, double out_value[CURVE_COMPONENTS]);
