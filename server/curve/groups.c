#include "curve/groups.h"

#include <math.h>

static enum result shape_of(const double *figures, int count, const char *name,
                            struct group_shape *out, struct error *err) {
    double sum = 0, squares = 0;
    if (count < GROUP_MIN)
        return fail(err, RESULT_REFUSED, "%d %s: a pass mark needs %d in each group", count, name,
                    GROUP_MIN);
    for (int i = 0; i < count; i++) {
        if (!isfinite(figures[i]))
            return fail(err, RESULT_INVALID, "%s: figure %d is not a number", name, i + 1);
        sum += figures[i];
    }
    out->mean = sum / count;
    for (int i = 0; i < count; i++)
        squares += (figures[i] - out->mean) * (figures[i] - out->mean);
    out->sd = sqrt(squares / (count - 1));
    if (!(out->sd > 1e-12 * fabs(out->mean)))
        return fail(err, RESULT_REFUSED, "%s: all figures are the same, %g", name, out->mean);
    return RESULT_OK;
}

// The logarithm of b's density over a's.
static double log_ratio(const struct group_shape *a, const struct group_shape *b, double x) {
    double of_a = (x - a->mean) / a->sd, of_b = (x - b->mean) / b->sd;
    return log(a->sd / b->sd) + (of_a * of_a - of_b * of_b) / 2;
}

// A quadratic has one root where it changes sign, and the mean of each group is on its own side.
static double crossing(const struct group_shape *novices, const struct group_shape *experts) {
    double low = novices->mean, high = experts->mean; // low: more likely a novice's figure
    for (int i = 0; i < 200; i++) {
        double middle = low + (high - low) / 2;
        if (log_ratio(novices, experts, middle) < 0)
            low = middle;
        else
            high = middle;
    }
    return low + (high - low) / 2;
}

static double normal_below(const struct group_shape *group, double x) {
    return erfc((group->mean - x) / (group->sd * sqrt(2))) / 2;
}

static int count_below(const double *figures, int count, double mark, bool or_at) {
    int below = 0;
    for (int i = 0; i < count; i++)
        below += figures[i] < mark || (or_at && figures[i] == mark);
    return below;
}

enum result contrasting_groups(const double *novices, int novice_count, const double *experts,
                               int expert_count, bool less_is_better,
                               struct contrasting_groups *out, struct error *err) {
    struct group_shape *n = &out->novices, *e = &out->experts;
    enum result result = shape_of(novices, novice_count, "novices", n, err);
    if (result == RESULT_OK)
        result = shape_of(experts, expert_count, "experts", e, err);
    if (result != RESULT_OK)
        return result;
    if (less_is_better ? e->mean >= n->mean : e->mean <= n->mean)
        return fail(err, RESULT_REFUSED,
                    "experts have a mean of %g, novices of %g: the experts are not better", e->mean,
                    n->mean);
    if (log_ratio(n, e, n->mean) >= 0 || log_ratio(n, e, e->mean) <= 0)
        return fail(err, RESULT_REFUSED,
                    "the groups overlap: novices %g ± %g and experts %g ± %g do not cross between "
                    "their means",
                    n->mean, n->sd, e->mean, e->sd);
    out->mark = crossing(n, e);
    double novices_below = normal_below(n, out->mark), experts_below = normal_below(e, out->mark);
    out->false_pass = less_is_better ? novices_below : 1 - novices_below;
    out->false_fail = less_is_better ? 1 - experts_below : experts_below;
    out->novices_passing =
        less_is_better ? count_below(novices, novice_count, out->mark, true)
                       : novice_count - count_below(novices, novice_count, out->mark, false);
    out->experts_failing = less_is_better
                               ? expert_count - count_below(experts, expert_count, out->mark, true)
                               : count_below(experts, expert_count, out->mark, false);
    return RESULT_OK;
}
