#include "match/cubic.h"

#include <math.h>

double cubic_at(const struct cubic *p, double s) {
    return p->c[0] + s * (p->c[1] + s * (p->c[2] + s * p->c[3]));
}

static double slope_at(const struct cubic *p, double s) {
    return p->c[1] + s * (2 * p->c[2] + s * 3 * p->c[3]);
}

// Where the slope is 0, ascending; NaN or an infinity where it is so nowhere.
static void turning_points(const struct cubic *p, double out_s[2]) {
    double a = 3 * p->c[3], b = p->c[2], c = p->c[1];
    double q = -(b + copysign(sqrt(b * b - a * c), b));
    double one = q / a, other = c / q;
    out_s[0] = fmin(one, other);
    out_s[1] = fmax(one, other);
}

#define STEPS_MAX 100

// Newton, and a bisection where it would leave the bracket: p(low) > 0 >= p(high), monotone.
static double root_between(const struct cubic *p, double low, double high, double tolerance,
                           int *steps) {
    double s = high;
    for (int i = 0; i < STEPS_MAX; i++) {
        double value = cubic_at(p, s);
        if (fabs(value) <= tolerance)
            break;
        *(value > 0 ? &low : &high) = s;
        double next = s - value / slope_at(p, s);
        if (!(next > low && next < high))
            next = low + (high - low) / 2;
        if (next <= low || next >= high)
            break;
        s = next;
        ++*steps;
    }
    return s;
}

bool cubic_descend(const struct cubic *p, double low, double high, double tolerance, double *out_s,
                   int *steps) {
    *out_s = low;
    double turns[3], least = cubic_at(p, low), from = low;
    if (least <= 0)
        return true;
    turning_points(p, turns);
    turns[2] = high;
    for (int i = 0; i < 3; i++) {
        double to = turns[i];
        if (!(to > from && to <= high))
            continue;
        double value = cubic_at(p, to);
        if (value <= 0) {
            *out_s = root_between(p, from, to, tolerance, steps);
            return true;
        }
        if (value < least) {
            least = value;
            *out_s = to;
        }
        from = to;
    }
    return false;
}
