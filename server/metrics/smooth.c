#include "metrics/smooth.h"

#include "base/check.h"

#include <string.h>

// The sixth power of 1 + x + ... + x^7, of its 43 the first 22.
static const double weights[SMOOTH_TAPS / 2 + 1] = {
    1,    6,    21,   56,   126,   252,   462,   792,   1281,  1966,  2877,
    4032, 5432, 7056, 8856, 10752, 12642, 14412, 15946, 17136, 17892, 18152};

_Static_assert(SMOOTH_BOX == 8, "the weights are those of boxes of 8");

#define WEIGHT_SUM 262144.0 // 8^6: no rounding

void smooth_init(struct smooth *s) {
    memset(s, 0, sizeof *s);
}

void smooth_break(struct smooth *s) {
    s->running = false;
}

static void begin(struct smooth *s, int64_t time_ns, vec3 position) {
    s->running = s->first = true;
    s->last_ns = time_ns;
    s->last = position;
    s->cell = time_ns / SMOOTH_PERIOD_NS;
    s->whole = time_ns % SMOOTH_PERIOD_NS == 0;
    s->sum = (vec3){0};
    s->count = s->next = 0;
}

static vec3 filtered(const struct smooth *s) {
    vec3 sum = {0};
    for (int i = 0; i < SMOOTH_TAPS; i++) {
        int mirrored = i <= SMOOTH_TAPS / 2 ? i : SMOOTH_TAPS - 1 - i;
        sum = vec3_add_scaled(sum, weights[mirrored], s->cells[(s->next + i) % SMOOTH_TAPS]);
    }
    return vec3_scale(1 / WEIGHT_SUM, sum);
}

// The cell is complete: 1 where a point came out.
static int close_cell(struct smooth *s, struct smooth_point *out) {
    int produced = 0;
    if (s->whole) {
        s->cells[s->next] = vec3_scale(1.0 / SMOOTH_PERIOD_NS, s->sum);
        s->next = (s->next + 1) % SMOOTH_TAPS;
        s->count += s->count < SMOOTH_TAPS;
    }
    if (s->count == SMOOTH_TAPS) {
        *out = (struct smooth_point){s->cell - SMOOTH_TAPS / 2, s->first, filtered(s)};
        s->first = false;
        produced = 1;
    }
    s->cell++;
    s->whole = true;
    s->sum = (vec3){0};
    return produced;
}

int smooth_feed(struct smooth *s, int64_t time_ns, vec3 position,
                struct smooth_point out_points[SMOOTH_OUT_MAX]) {
    CHECK(time_ns >= 0);
    if (!s->running || time_ns - s->last_ns > SMOOTH_BRIDGE_NS) {
        if (!s->running || time_ns > s->last_ns)
            begin(s, time_ns, position);
        return 0;
    }
    int count = 0;
    double span_ns = (double)(time_ns - s->last_ns);
    for (int64_t from_ns = s->last_ns; from_ns < time_ns;) {
        int64_t end_ns = (s->cell + 1) * SMOOTH_PERIOD_NS;
        int64_t to_ns = end_ns < time_ns ? end_ns : time_ns;
        double middle = 0.5 * (double)(from_ns + to_ns - 2 * s->last_ns) / span_ns;
        s->sum = vec3_add_scaled(s->sum, (double)(to_ns - from_ns),
                                 vec3_lerp(s->last, position, middle));
        if (to_ns == end_ns)
            count += close_cell(s, &out_points[count]);
        from_ns = to_ns;
    }
    if (time_ns > s->last_ns) {
        s->last_ns = time_ns;
        s->last = position;
    }
    return count;
}
