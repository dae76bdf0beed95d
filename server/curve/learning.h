// The learning curve of one trainee at one task: when its attempts show competence, and whether
// they still do. LC-CUSUM: Biau, Williams, Schlup, Nizard, Porcher, Br J Surg 95:925-929 (2008);
// Biau, Porcher, Stat Med 29:1900-1909 (2010).
//
//     S_t = max(0, S_t-1 + W_t),  W = ln((1 - p1) / (1 - p0)) after a success,
//                                 W = ln(p1 / p0)             after a failure;
//
// competent at S_t >= h. p1 is the failure rate of adequate performance, and p0 = p1 + the
// acceptable deviation from it. For knee arthroscopy Hodgins et al. (Arthroscopy 30:613-621, 2014)
// take p1 0.10, a deviation of 0.10 and h 1.6. Of trainees who fail 10 % of their attempts 90 % are
// called competent within 50, and of trainees who fail 30 %, 10 %. The 30 % are no part of W: with
// p0 = 0.30, h 1.6 would call 78 % of the latter competent.
//
// Afterwards the score falls from 0 by the same weights, and never rises above 0 (the CUSUM of
// Page, Biometrika 41:100-115, 1954, drawn downwards):
//
//     R_t = min(0, R_t-1 + W_t),  a relapse at R_t <= -relapse.
//
// Its limit of 2.6 is ours, in the same way: of trainees who fail 10 % of their attempts, 9 % are
// shown a relapse within 50; of those who fail 30 %, 98 %. After a relapse the curve begins anew.
#pragma once

#include "base/result.h"

#include <stdbool.h>

// Rates are shares from 0 to 1, limits are sums of natural logarithms.
struct learning_rule {
    double accepted_rate; // p1
    double rejected_rate; // p0
    double limit;         // h
    double relapse;
};

extern const struct learning_rule learning_rule_knee; // 0.10, 0.20, 1.6, 2.6

enum learning_state { LEARNING, COMPETENT };

// After an attempt. A curve begins with all zero.
struct learning_point {
    enum learning_state state;
    double score; // while learning 0 to limit, afterwards 0 to -relapse; where the state changes,
                  // the value that crossed the limit
    bool changed; // by this attempt: competence, or a relapse
};

// RESULT_INVALID unless 0 < accepted_rate < rejected_rate < 1 and both limits are positive.
enum result learning_rule_check(const struct learning_rule *rule, struct error *err);

// What the score gains by a success (positive) and by a failure (negative).
double learning_weight(const struct learning_rule *rule, bool success);

// The next point. The rule is valid.
struct learning_point learning_next(const struct learning_rule *rule, struct learning_point before,
                                    bool success);

// All points of `count` attempts, in their order.
void learning_curve(const struct learning_rule *rule, const bool *successes, int count,
                    struct learning_point *out_points);
