#include "calibrate/delay.h"

#include "base/check.h"
#include "base/clock.h"
#include "calibrate/eigen.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STEPS (DELAY_MOST_MS - DELAY_LEAST_MS + 1) // of 1 ms
#define TURNS_MIN 100
#define RANGE_MIN_DEG 15
#define SPEED_MIN_DEG_S 10
#define UNCERTAINTY_MAX_MS 0.5 // two standard deviations: 1 ms
#define UNTOLD_MAX 0.02        // of the flexion's variance
#define BLOCKS 8               // of time, each of which is left out once

// ---- the two motions ----------------------------------------------------------------------------

// The turns that have a flexion at every delay. Each as a rotation vector from the middle one.
struct motion {
    const struct delay_flexion *flexions;
    int flexion_count, count;
    int64_t *times_ns;
    vec3 *turns;   // less their mean
    double *bends; // deg, at the delay that is tried
};

static vec3 rotation_vector(quat from, quat to) {
    quat q = quat_multiply(quat_conjugate(from), to);
    if (q.w < 0)
        q = (quat){-q.w, -q.x, -q.y, -q.z};
    double sine = sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    double scale = sine > 1e-12 ? 2 * atan2(sine, q.w) / sine : 2;
    return (vec3){scale * q.x, scale * q.y, scale * q.z};
}

static void centre(vec3 *points, int count) {
    vec3 mean = {0, 0, 0};
    for (int i = 0; i < count; i++)
        mean = vec3_add_scaled(mean, 1.0 / count, points[i]);
    for (int i = 0; i < count; i++)
        points[i] = vec3_sub(points[i], mean);
}

static void take_turns(struct motion *m, const struct delay_turn *turns, int count) {
    int64_t first_ns = m->flexions[0].time_ns + DELAY_MOST_MS * NS_PER_MS;
    int64_t last_ns = m->flexions[m->flexion_count - 1].time_ns + DELAY_LEAST_MS * NS_PER_MS;
    for (int i = 0; i < count; i++) {
        if (turns[i].time_ns < first_ns || turns[i].time_ns > last_ns)
            continue;
        m->times_ns[m->count] = turns[i].time_ns;
        m->turns[m->count++] = rotation_vector(turns[count / 2].rotation, turns[i].rotation);
    }
    centre(m->turns, m->count);
}

// Flexion straight between its samples, less its mean. Returns its sum of squares.
static double bend_at(struct motion *m, double delay_ms) {
    double sum = 0, squares = 0;
    for (int i = 0, k = 0; i < m->count; i++) {
        int64_t time_ns = m->times_ns[i] - (int64_t)(delay_ms * NS_PER_MS);
        while (k + 2 < m->flexion_count && m->flexions[k + 1].time_ns <= time_ns)
            k++;
        const struct delay_flexion *a = &m->flexions[k], *b = a + 1;
        double share = (double)(time_ns - a->time_ns) / (double)(b->time_ns - a->time_ns);
        m->bends[i] = a->deg + share * (b->deg - a->deg);
        sum += m->bends[i];
    }
    for (int i = 0; i < m->count; i++) {
        m->bends[i] -= sum / m->count;
        squares += m->bends[i] * m->bends[i];
    }
    return squares;
}

// ---- least squares ------------------------------------------------------------------------------

// Axes of the turns. A hinge turns about one alone: an axis of next to nothing tells nothing.
struct axes {
    int count;
    vec3 unit[3];
    double squares[3];
};

static struct axes axes_of(const struct motion *m) {
    double spread[EIGEN_MAX][EIGEN_MAX] = {{0}};
    struct axes axes = {.count = 0};
    struct eigen eigen;
    for (int i = 0; i < m->count; i++) {
        const double r[3] = {m->turns[i].x, m->turns[i].y, m->turns[i].z};
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                spread[j][k] += r[j] * r[k];
    }
    eigen_symmetric(3, spread, &eigen);
    for (int k = 0; k < 3 && eigen.values[k] > 1e-9 * eigen.values[0]; k++) {
        const double *v = eigen.vectors[k];
        axes.unit[k] = (vec3){v[0], v[1], v[2]};
        axes.squares[axes.count++] = eigen.values[k];
    }
    return axes;
}

// What the turns leave of the flexion's sum of squares.
static double untold(struct motion *m, const struct axes *axes, double delay_ms) {
    double left = bend_at(m, delay_ms);
    vec3 both = {0, 0, 0};
    for (int i = 0; i < m->count; i++)
        both = vec3_add_scaled(both, m->bends[i], m->turns[i]);
    for (int k = 0; k < axes->count; k++) {
        double along = vec3_dot(both, axes->unit[k]);
        left -= along * along / axes->squares[k];
    }
    return fmax(0, left);
}

static double speed_of(const struct motion *m) {
    double squares = 0;
    int count = 0;
    for (int i = 1; i < m->count; i++) {
        double seconds = (double)(m->times_ns[i] - m->times_ns[i - 1]) / NS_PER_S;
        double speed = (m->bends[i] - m->bends[i - 1]) / seconds;
        squares += speed * speed;
        count++;
    }
    return sqrt(squares / count);
}

static double range_of(const struct motion *m) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < m->count; i++) {
        low = fmin(low, m->bends[i]);
        high = fmax(high, m->bends[i]);
    }
    return high - low;
}

// The lowest of the whole milliseconds; between its neighbours a parabola. False: it is at an end.
static bool find_delay(struct motion *m, double *out_delay_ms, double *out_left) {
    struct axes axes = axes_of(m);
    double left[STEPS];
    int best = 0;
    for (int i = 0; i < STEPS; i++) {
        left[i] = untold(m, &axes, DELAY_LEAST_MS + i);
        best = left[i] < left[best] ? i : best;
    }
    *out_delay_ms = DELAY_LEAST_MS + best;
    *out_left = left[best];
    if (best == 0 || best == STEPS - 1)
        return false;
    double bend = left[best - 1] + left[best + 1] - 2 * left[best];
    if (bend > 0)
        *out_delay_ms += (left[best - 1] - left[best + 1]) / (2 * bend);
    return true;
}

// The jackknife's: how much the delay changes where one block of time after the other is left out.
static double uncertainty_of(const struct motion *whole) {
    struct motion m = *whole;
    double delays[BLOCKS], left, mean = 0, squares = 0;
    m.times_ns = alloc((size_t)whole->count, sizeof *m.times_ns);
    m.turns = alloc((size_t)whole->count, sizeof *m.turns);
    for (int b = 0; b < BLOCKS; b++) {
        m.count = 0;
        for (int i = 0; i < whole->count; i++)
            if (i * BLOCKS / whole->count != b) {
                m.times_ns[m.count] = whole->times_ns[i];
                m.turns[m.count++] = whole->turns[i];
            }
        centre(m.turns, m.count);
        find_delay(&m, &delays[b], &left);
        mean += delays[b] / BLOCKS;
    }
    for (int b = 0; b < BLOCKS; b++)
        squares += (delays[b] - mean) * (delays[b] - mean);
    free(m.times_ns);
    free(m.turns);
    return sqrt(squares * (BLOCKS - 1) / BLOCKS);
}

static bool measure_delay(struct motion *m, struct delay_fit *out, double *out_untold_share) {
    double left;
    bool inside = find_delay(m, &out->delay_ms, &left);
    out->uncertainty_ms = uncertainty_of(m);
    *out_untold_share = left / bend_at(m, out->delay_ms);
    out->residual_deg = sqrt(left / m->count);
    out->range_deg = range_of(m);
    out->speed_deg_s = speed_of(m);
    return inside;
}

// ---- the interface ------------------------------------------------------------------------------

static enum result judge(const struct delay_fit *fit, double untold_share, bool inside,
                         struct error *err) {
    if (!(fit->range_deg >= RANGE_MIN_DEG) || !(fit->speed_deg_s >= SPEED_MIN_DEG_S))
        return fail(err, RESULT_INVALID,
                    "flexion moved by %.0f degrees, at %.0f degrees a second: too little. Bend and "
                    "stretch the knee quickly, by %d degrees at least",
                    fit->range_deg, fit->speed_deg_s, 2 * RANGE_MIN_DEG);
    if (!(untold_share <= UNTOLD_MAX))
        return fail(err, RESULT_INVALID,
                    "the tool does not turn as the joint bends (%.1f degrees off). Fix it to the "
                    "bone that moves, and move that bone alone",
                    fit->residual_deg);
    if (!inside)
        return fail(err, RESULT_INVALID, "the delay is not between %d and %d ms", DELAY_LEAST_MS,
                    DELAY_MOST_MS);
    if (!(fit->uncertainty_ms <= UNCERTAINTY_MAX_MS))
        return fail(err, RESULT_INVALID,
                    "the delay is known to %.1f ms only. Move the joint faster, or for longer",
                    2 * fit->uncertainty_ms);
    return RESULT_OK;
}

enum result delay_calibrate(const struct delay_flexion *flexions, int flexion_count,
                            const struct delay_turn *turns, int turn_count, struct delay_fit *out,
                            struct error *err) {
    struct motion m = {.flexions = flexions, .flexion_count = flexion_count};
    double untold_share = 1;
    memset(out, 0, sizeof *out);
    size_t room = turn_count > 0 ? (size_t)turn_count : 1;
    m.times_ns = alloc(room, sizeof *m.times_ns);
    m.turns = alloc(room, sizeof *m.turns);
    m.bends = alloc(room, sizeof *m.bends);
    if (flexion_count > 1)
        take_turns(&m, turns, turn_count);
    enum result result = RESULT_OK;
    if (m.count < TURNS_MIN)
        result =
            fail(err, RESULT_MISSING,
                 "%d poses and %d angles came at the same time: too few. Keep the tool in view",
                 m.count, flexion_count);
    else {
        bool inside = measure_delay(&m, out, &untold_share);
        result = judge(out, untold_share, inside, err);
    }
    free(m.times_ns);
    free(m.turns);
    free(m.bends);
    return result;
}
