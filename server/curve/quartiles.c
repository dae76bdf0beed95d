#include "curve/quartiles.h"

#include "base/check.h"

#include <math.h>
#include <stdlib.h>

double sorted_quantile(const double *figures, int count, double share) {
    double place = (count - 1) * share;
    int below = (int)place, above = below + 1 < count ? below + 1 : below;
    return figures[below] + (place - below) * (figures[above] - figures[below]);
}

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int take_attempt(const double *figures, const int *starts, int trainees, int attempt,
                        double *out) {
    int count = 0;
    for (int i = 0; i < trainees; i++)
        if (starts[i] + attempt < starts[i + 1])
            out[count++] = figures[starts[i] + attempt];
    return count;
}

void quartile_curve(const double *figures, const int *starts, int trainees, int attempts, int least,
                    struct quartiles *out) {
    CHECK(least >= 1);
    double *taken = alloc((unsigned long)trainees + 1, sizeof *taken);
    for (int k = 0; k < attempts; k++) {
        int count = take_attempt(figures, starts, trainees, k, taken);
        out[k] = (struct quartiles){count, NAN, NAN, NAN};
        if (count < least)
            continue;
        qsort(taken, (size_t)count, sizeof *taken, by_value);
        out[k].low = sorted_quantile(taken, count, 0.25);
        out[k].middle = sorted_quantile(taken, count, 0.5);
        out[k].high = sorted_quantile(taken, count, 0.75);
    }
    free(taken);
}
