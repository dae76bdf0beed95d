#include "curve/learning.h"

#include <math.h>

const struct learning_rule learning_rule_knee = {
    .accepted_rate = 0.10, .rejected_rate = 0.20, .limit = 1.6, .relapse = 2.6};

enum result learning_rule_check(const struct learning_rule *rule, struct error *err) {
    if (!(rule->accepted_rate > 0 && rule->rejected_rate < 1 &&
          rule->accepted_rate < rule->rejected_rate))
        return fail(err, RESULT_INVALID,
                    "failure rates %g and %g: the accepted one has to be above 0 and below the "
                    "rejected one, which is below 1",
                    rule->accepted_rate, rule->rejected_rate);
    if (!(rule->limit > 0 && rule->relapse > 0 && isfinite(rule->limit) && isfinite(rule->relapse)))
        return fail(err, RESULT_INVALID, "limits %g and %g: they have to be above 0", rule->limit,
                    rule->relapse);
    return RESULT_OK;
}

double learning_weight(const struct learning_rule *rule, bool success) {
    return success ? log((1 - rule->accepted_rate) / (1 - rule->rejected_rate))
                   : log(rule->accepted_rate / rule->rejected_rate);
}

static double score_before(struct learning_point before) {
    return before.changed ? 0 : before.score;
}

struct learning_point learning_next(const struct learning_rule *rule, struct learning_point before,
                                    bool success) {
    struct learning_point next = {.state = before.state};
    double score = score_before(before) + learning_weight(rule, success);
    if (before.state == COMPETENT) {
        next.score = fmin(0, score);
        next.changed = next.score <= -rule->relapse;
    } else {
        next.score = fmax(0, score);
        next.changed = next.score >= rule->limit;
    }
    if (next.changed)
        next.state = before.state == COMPETENT ? LEARNING : COMPETENT;
    return next;
}

void learning_curve(const struct learning_rule *rule, const bool *successes, int count,
                    struct learning_point *out_points) {
    struct learning_point point = {0};
    for (int i = 0; i < count; i++)
        out_points[i] = point = learning_next(rule, point, successes[i]);
}
