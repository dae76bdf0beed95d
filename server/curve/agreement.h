// How far raters of the same performances agree.
#pragma once

#include "base/result.h"

#define RATERS_MAX 8
#define LEVELS_MAX 64

// Shrout, Fleiss, Psychological Bulletin 86:420-428 (1979), of single ratings, with the mean
// squares between targets (BMS), within them (WMS), between raters (JMS), and the rest (EMS):
//
//     ICC(1,1) = (BMS - WMS) / (BMS + (k - 1) WMS)
//     ICC(2,1) = (BMS - EMS) / (BMS + (k - 1) EMS + k (JMS - EMS) / n)
//
// (1,1): each target was rated by other raters. (2,1): the same raters rated all of them. 1 is full
// agreement; a value may be negative.
struct intraclass {
    double icc_1_1, icc_2_1;
};

// ratings: of target i by rater j at [i * raters + j], all finite. 2 to RATERS_MAX raters.
// RESULT_REFUSED: fewer than 2 targets, or ratings without any difference, of which it says
// nothing.
enum result intraclass(const double *ratings, int targets, int raters, struct intraclass *out,
                       struct error *err);

enum kappa_weights {
    KAPPA_PLAIN,    // Cohen, Educational and Psychological Measurement 20:37-46 (1960), eq. 1
    KAPPA_LINEAR,   // Cohen, Psychological Bulletin 70:213-220 (1968): disagreement |i - j|
    KAPPA_QUADRATIC // the same, (i - j)^2
};

// kappa = 1 - (disagreement observed) / (disagreement expected by chance), weighted.
// first, second: the levels, from 0 to levels - 1, that two raters gave to `count` targets; levels
// at most LEVELS_MAX. RESULT_INVALID: a level out of range. RESULT_REFUSED: no targets, or all
// ratings at one level, so that chance would agree as well.
enum result kappa(const int *first, const int *second, int count, int levels,
                  enum kappa_weights weights, double *out_kappa, struct error *err);
