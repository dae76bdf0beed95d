#include "samples/past.h"

#include "base/check.h"

static const struct sample *newest_but(const struct past *h, int back) {
    return &h->samples[(h->next - 1 - back + 2 * PAST_SAMPLES) % PAST_SAMPLES];
}

void past_add(struct past *h, const struct sample *sample) {
    if (sample->kind == SAMPLE_HANDLE)
        return;
    CHECK(!h->count || sample->time_ns > newest_but(h, 0)->time_ns);
    bool is_between =
        h->count > 1 && newest_but(h, 0)->time_ns - newest_but(h, 1)->time_ns < PAST_APART_NS;
    if (is_between) { // the newest stood only until now
        h->next = (h->next - 1 + PAST_SAMPLES) % PAST_SAMPLES;
        h->count--;
    }
    h->samples[h->next] = *sample;
    h->next = (h->next + 1) % PAST_SAMPLES;
    h->count += h->count < PAST_SAMPLES;
}

static struct sample between(const struct sample *a, const struct sample *b, int64_t time_ns) {
    double share = (double)(time_ns - a->time_ns) / (double)(b->time_ns - a->time_ns);
    struct sample at = *b;
    at.time_ns = time_ns;
    if (b->kind == SAMPLE_JOINT)
        at.joint = joint_interpolate(&a->joint, &b->joint, share);
    else if (b->kind == SAMPLE_FORCE)
        at.force_n = a->force_n + share * (b->force_n - a->force_n);
    else
        at.T_mockup_body = pose_interpolate(a->T_mockup_body, b->T_mockup_body, share);
    return at;
}

bool past_at(const struct past *h, int64_t time_ns, struct sample *out) {
    int back = 0;
    if (!h->count)
        return false;
    while (back < h->count && newest_but(h, back)->time_ns > time_ns)
        back++;
    if (back == 0 || back == h->count)
        *out = *newest_but(h, back ? h->count - 1 : 0);
    else
        *out = between(newest_but(h, back), newest_but(h, back - 1), time_ns);
    return true;
}

void past_forget(struct past *h) {
    h->count = 0;
}
