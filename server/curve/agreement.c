#include "curve/agreement.h"

#include "base/check.h"

#include <math.h>
#include <stdlib.h>

struct sums {
    double all, targets, raters; // of squared deviations
};

static double mean_of(const double *values, int count, int stride) {
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += values[i * stride];
    return sum / count;
}

static double squared(double x) {
    return x * x;
}

static struct sums sums_of(const double *ratings, int targets, int raters) {
    struct sums sums = {0};
    double mean = mean_of(ratings, targets * raters, 1);
    for (int i = 0; i < targets; i++)
        sums.targets += raters * squared(mean_of(ratings + i * raters, raters, 1) - mean);
    for (int j = 0; j < raters; j++)
        sums.raters += targets * squared(mean_of(ratings + j, targets, raters) - mean);
    for (int i = 0; i < targets * raters; i++)
        sums.all += squared(ratings[i] - mean);
    return sums;
}

enum result intraclass(const double *ratings, int targets, int raters, struct intraclass *out,
                       struct error *err) {
    CHECK(raters >= 2 && raters <= RATERS_MAX);
    if (targets < 2)
        return fail(err, RESULT_REFUSED, "%d rated performances: agreement needs at least 2",
                    targets);
    struct sums sums = sums_of(ratings, targets, raters);
    double n = targets, k = raters;
    double between = sums.targets / (n - 1), raters_ms = sums.raters / (k - 1);
    double within = (sums.all - sums.targets) / (n * (k - 1));
    double rest = (sums.all - sums.targets - sums.raters) / ((n - 1) * (k - 1));
    double below_1 = between + (k - 1) * within;
    double below_2 = between + (k - 1) * rest + k * (raters_ms - rest) / n;
    if (!(below_1 > 0 && below_2 > 0))
        return fail(err, RESULT_REFUSED,
                    "the ratings do not differ enough to say whether the raters agree");
    *out = (struct intraclass){.icc_1_1 = (between - within) / below_1,
                               .icc_2_1 = (between - rest) / below_2};
    return RESULT_OK;
}

static double disagreement(enum kappa_weights weights, int i, int j) {
    double apart = abs(i - j);
    if (weights == KAPPA_PLAIN)
        return apart > 0;
    return weights == KAPPA_LINEAR ? apart : apart * apart;
}

enum result kappa(const int *first, const int *second, int count, int levels,
                  enum kappa_weights weights, double *out_kappa, struct error *err) {
    double of_first[LEVELS_MAX] = {0}, of_second[LEVELS_MAX] = {0}, observed = 0, expected = 0;
    CHECK(levels >= 2 && levels <= LEVELS_MAX);
    for (int i = 0; i < count; i++) {
        if (first[i] < 0 || first[i] >= levels || second[i] < 0 || second[i] >= levels)
            return fail(err, RESULT_INVALID, "rating %d: levels %d and %d are not from 0 to %d",
                        i + 1, first[i], second[i], levels - 1);
        of_first[first[i]]++;
        of_second[second[i]]++;
        observed += disagreement(weights, first[i], second[i]);
    }
    for (int i = 0; i < levels; i++)
        for (int j = 0; j < levels; j++)
            expected += of_first[i] * of_second[j] * disagreement(weights, i, j);
    if (!(expected > 0))
        return fail(err, RESULT_REFUSED,
                    "the ratings do not differ, so nothing tells agreement from chance");
    *out_kappa = 1 - observed * count / expected;
    return RESULT_OK;
}
