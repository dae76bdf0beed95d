#include "samples/noise.h"

#include "base/clock.h"

static const double acceleration_mm_s2 = 40000, acceleration_rad_s2 = 400;
static const double score_max = 4, score_kept = 0.9; // from one pose to the next
enum { BASELINE = 8 };                               // poses that tell the motion

// Noise of standard deviation 1 in each of three directions has fourth differences of variance
// 1 + 16 + 36 + 16 + 1; three tenths of their lengths are below 1.193 of its root.
enum { FOURTH = 4, BELOW = 3 * NOISE_SPAN / 10 };
static const double rank_length = 1.193, fourth_variance = 70;
static const double least_share = 0.9; // of the limit: an estimate by so few poses scatters

// How far the pose lies from 2 p1 - p0, over what is allowed; by the index, not by time stamps that
// shake themselves. That difference has 1 + 4 + 1 times the variance in each of three directions.
static double excess(const struct history *h, double limit_mm, double limit_rad, pose p) {
    pose p1 = h->poses[history_place(h, 0)], p0 = h->poses[history_place(h, 1)];
    int from = history_place(h, BASELINE - 1);
    double dt_s =
        (double)(h->time_ns[history_place(h, 0)] - h->time_ns[from]) / NS_PER_S / (BASELINE - 1);
    double step_mm = vec3_distance(p1.translation, h->poses[from].translation) / (BASELINE - 1);
    double step_rad = quat_angle(p1.rotation, h->poses[from].rotation) / (BASELINE - 1);
    pose expected = pose_interpolate(p0, p1, 2);
    double mm = vec3_distance(p.translation, expected.translation) /
                (sqrt(18) * limit_mm + acceleration_mm_s2 * dt_s * dt_s + 2 * step_mm);
    double rad = quat_angle(p.rotation, expected.rotation) /
                 (sqrt(18) * limit_rad + acceleration_rad_s2 * dt_s * dt_s + 2 * step_rad);
    return fmax(mm, rad);
}

static double length_of(const double *v, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += v[i] * v[i];
    return sqrt(sum);
}

// Of the newest poses. A quaternion tells half of a small turn, and q and -q are the same.
static void add_fourth_difference(struct noise *n) {
    static const double weights[FOURTH + 1] = {1, -4, 6, -4, 1};
    const double scale = rank_length * sqrt(fourth_variance);
    double mm[3] = {0}, half[4] = {0};
    quat last = n->recent.poses[history_place(&n->recent, 0)].rotation;
    for (int i = 0; i <= FOURTH; i++) {
        pose p = n->recent.poses[history_place(&n->recent, i)];
        vec3 t = p.translation;
        quat q = p.rotation;
        if (q.w * last.w + q.x * last.x + q.y * last.y + q.z * last.z < 0)
            q = (quat){-q.w, -q.x, -q.y, -q.z};
        last = q;
        const double at[3] = {t.x, t.y, t.z}, turn[4] = {q.w, q.x, q.y, q.z};
        for (int k = 0; k < 3; k++)
            mm[k] += weights[i] * at[k];
        for (int k = 0; k < 4; k++)
            half[k] += weights[i] * turn[k];
    }
    n->mm[n->next] = length_of(mm, 3) / scale;
    n->rad[n->next] = 2 * length_of(half, 4) / scale;
    n->next = (n->next + 1) % NOISE_SPAN;
    n->count += n->count < NOISE_SPAN;
}

static bool most_exceed(const double values[NOISE_SPAN], double limit) {
    int above = 0;
    for (int i = 0; i < NOISE_SPAN; i++)
        above += values[i] > limit;
    return above >= NOISE_SPAN - BELOW;
}

static bool shakes_steadily(struct noise *n, double limit_mm, double limit_deg) {
    if (n->recent.count <= FOURTH)
        return false;
    add_fourth_difference(n);
    return n->count == NOISE_SPAN && (most_exceed(n->mm, least_share * limit_mm) ||
                                      most_exceed(n->rad, least_share * limit_deg * RAD_PER_DEG));
}

bool noise_is_high(struct noise *n, double limit_mm, double limit_deg, int64_t time_ns, pose p) {
    struct history *h = &n->recent;
    if (h->count && time_ns - h->time_ns[history_place(h, 0)] > NOISE_MEMORY_NS)
        *n = (struct noise){0};
    n->score *= score_kept;
    if (h->count >= BASELINE) {
        double e = excess(h, limit_mm, limit_deg * RAD_PER_DEG, p);
        n->score = fmax(n->score, fmin(score_max, e * e));
    }
    history_add(h, time_ns, p);
    return shakes_steadily(n, limit_mm, limit_deg) || n->score > 1;
}
