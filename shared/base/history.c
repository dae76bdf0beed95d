#include "base/history.h"

bool history_add(struct history *h, int64_t time_ns, pose p) {
    if (h->count && time_ns <= h->time_ns[history_place(h, 0)])
        return false;
    h->time_ns[h->next] = time_ns;
    h->poses[h->next] = p;
    h->next = (h->next + 1) % HISTORY_LENGTH;
    if (h->count < HISTORY_LENGTH)
        h->count++;
    return true;
}

static pose between(const struct history *h, int older, int newer, int64_t time_ns) {
    double span = (double)(h->time_ns[newer] - h->time_ns[older]);
    double t = (double)(time_ns - h->time_ns[older]) / span;
    return pose_interpolate(h->poses[older], h->poses[newer], t);
}

static enum history_quality predict(const struct history *h, int64_t time_ns, int64_t longest_ns,
                                    pose *out_pose) {
    if (time_ns - h->time_ns[history_place(h, 0)] > longest_ns)
        return HISTORY_NONE;
    *out_pose = h->count < 2 ? h->poses[history_place(h, 0)]
                             : between(h, history_place(h, 1), history_place(h, 0), time_ns);
    return HISTORY_PREDICTED;
}

enum history_quality history_at(const struct history *h, int64_t time_ns, int64_t longest_ns,
                                pose *out_pose) {
    if (!h->count)
        return HISTORY_NONE;
    if (time_ns > h->time_ns[history_place(h, 0)])
        return predict(h, time_ns, longest_ns, out_pose);
    for (int i = 0; i < h->count; i++) {
        int at = history_place(h, i);
        if (h->time_ns[at] == time_ns) {
            *out_pose = h->poses[at];
            return HISTORY_EXACT;
        }
        if (h->time_ns[at] < time_ns) {
            *out_pose = between(h, at, history_place(h, i - 1), time_ns);
            return HISTORY_INTERPOLATED;
        }
    }
    return HISTORY_NONE;
}
