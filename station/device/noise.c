#include "device/noise.h"

#include "base/clock.h"

static const double acceleration_mm_s2 = 40000, acceleration_rad_s2 = 400;
static const double score_max = 4, score_kept = 0.9; // from one pose to the next
enum { BASELINE = 8 };                               // poses that tell the motion

static int nth_newest(const struct history *h, int i) {
    return (h->next - 1 - i + 2 * HISTORY_LENGTH) % HISTORY_LENGTH;
}

// How far the pose lies from 2 p1 - p0, over what is allowed; by the index, not by time stamps that
// shake themselves. That difference has 1 + 4 + 1 times the variance in each of three directions.
static double excess(const struct history *h, double limit_mm, double limit_rad, pose p) {
    pose p1 = h->poses[nth_newest(h, 0)], p0 = h->poses[nth_newest(h, 1)];
    int from = nth_newest(h, BASELINE - 1);
    double dt_s =
        (double)(h->time_ns[nth_newest(h, 0)] - h->time_ns[from]) / NS_PER_S / (BASELINE - 1);
    double step_mm = vec3_distance(p1.translation, h->poses[from].translation) / (BASELINE - 1);
    double step_rad = quat_angle(p1.rotation, h->poses[from].rotation) / (BASELINE - 1);
    pose expected = pose_interpolate(p0, p1, 2);
    double mm = vec3_distance(p.translation, expected.translation) /
                (sqrt(18) * limit_mm + acceleration_mm_s2 * dt_s * dt_s + 2 * step_mm);
    double rad = quat_angle(p.rotation, expected.rotation) /
                 (sqrt(18) * limit_rad + acceleration_rad_s2 * dt_s * dt_s + 2 * step_rad);
    return fmax(mm, rad);
}

bool noise_is_high(struct noise *n, double limit_mm, double limit_deg, int64_t time_ns, pose p) {
    struct history *h = &n->recent;
    if (h->count && time_ns - h->time_ns[nth_newest(h, 0)] > NOISE_MEMORY_NS)
        *n = (struct noise){0};
    n->score *= score_kept;
    if (h->count >= BASELINE) {
        double e = excess(h, limit_mm, limit_deg * RAD_PER_DEG, p);
        n->score = fmax(n->score, fmin(score_max, e * e));
    }
    history_add(h, time_ns, p);
    return n->score > 1;
}
