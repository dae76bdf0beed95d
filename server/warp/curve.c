#include "warp/curve.h"

#include "base/check.h"

#include <math.h>
#include <string.h>

bool curve_add(struct curve *c, double at, double gap, const double value[CURVE_COMPONENTS]) {
    for (int i = 0; i < c->count; i++)
        if (fabs(c->at[i] - at) < gap)
            return false;
    CHECK(c->count < CURVE_KNOTS_MAX);
    int i = c->count++;
    for (; i > 0 && c->at[i - 1] > at; i--) {
        c->at[i] = c->at[i - 1];
        memcpy(c->value[i], c->value[i - 1], sizeof c->value[i]);
    }
    c->at[i] = at;
    memcpy(c->value[i], value, sizeof c->value[i]);
    return true;
}

static double secant(const struct curve *c, int i, int component) {
    return (c->value[i + 1][component] - c->value[i][component]) / (c->at[i + 1] - c->at[i]);
}

// A piece is monotone where its slopes, over its secant, lie within a circle of radius 3.
static void limit(const struct curve *c, int i, int component, double *from, double *to) {
    double d = secant(c, i, component);
    double size = hypot(*from, *to);
    if (size > 3 * fabs(d)) {
        *from *= 3 * fabs(d) / size;
        *to *= 3 * fabs(d) / size;
    }
}

void curve_finish(struct curve *c) {
    for (int k = 0; k < CURVE_COMPONENTS; k++) {
        for (int i = 1; i + 1 < c->count; i++) {
            double before = secant(c, i - 1, k), after = secant(c, i, k);
            c->slope[i][k] = before * after > 0 ? (before + after) / 2 : 0;
        }
        for (int i = 0; i + 1 < c->count; i++)
            limit(c, i, k, &c->slope[i][k], &c->slope[i + 1][k]);
    }
}

void curve_at(const struct curve *c, double at, double out_value[CURVE_COMPONENTS]) {
    int last = c->count - 1, i = 0;
    if (last < 0) {
        memset(out_value, 0, CURVE_COMPONENTS * sizeof *out_value);
        return;
    }
    while (i < last && c->at[i + 1] <= at)
        i++;
    if (i == last || at <= c->at[i]) {
        memcpy(out_value, c->value[i], sizeof c->value[i]);
        return;
    }
    double width = c->at[i + 1] - c->at[i], t = (at - c->at[i]) / width, r = 1 - t;
    for (int k = 0; k < CURVE_COMPONENTS; k++)
        out_value[k] = r * r * ((1 + 2 * t) * c->value[i][k] + t * width * c->slope[i][k]) +
                       t * t * ((1 + 2 * r) * c->value[i + 1][k] - r * width * c->slope[i + 1][k]);
}
