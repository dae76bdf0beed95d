#include "drivers/hid_stamp.h"

#include "base/clock.h"

#include <math.h>

static const double longest_pause_ns = 250e6;       // beyond this the device was silent, whatever its rate
static const double count_creep = 1.0 / 50; // a device's count may be wrong by so much
static const double late_ns = 100e6;        // a count that is farther off counts something else
static const int64_t apart_ns = 1000;       // of two times, at the least

void hid_stamps_begin(struct hid_stamps *s) {
    s->is_counting = false;
    s->interval_ns = 0;
    s->arrival_ns = s->last_ns = 0;
}

static void learn_interval(struct hid_stamps *s, int n, int64_t now_ns) {
    double interval_ns = (double)(now_ns - s->arrival_ns) / n;
    if (!s->arrival_ns || now_ns - s->arrival_ns > longest_pause_ns)
        return;
    s->interval_ns += (s->interval_ns ? 0.1 : 1) * (interval_ns - s->interval_ns);
}

static void spread(const struct hid_stamps *s, int n, int64_t now_ns, int64_t *out_ns) {
    double step_ns = s->interval_ns;
    if (s->last_ns && s->last_ns < now_ns)
        step_ns = fmin(step_ns, (double)(now_ns - s->last_ns) / n);
    for (int i = 0; i < n; i++)
        out_ns[i] = now_ns - (int64_t)(step_ns * (n - 1 - i));
}

// The report with the least delay tells what the device's count is on our clock.
static void follow_counts(struct hid_stamps *s, const uint32_t *counts, int n, int64_t now_ns,
                          int64_t *out_ns) {
    uint32_t mask = s->counter_bits == 32 ? UINT32_MAX : (UINT32_C(1) << s->counter_bits) - 1;
    if (!s->is_counting || now_ns - s->arrival_ns > longest_pause_ns) {
        s->count = counts[0];
        s->device_ns = 0;
        s->offset_ns = (double)now_ns;
        s->is_counting = true;
    }
    s->offset_ns += count_creep * (double)(s->arrival_ns ? now_ns - s->arrival_ns : 0);
    for (int i = 0; i < n; i++) {
        s->device_ns += (double)((counts[i] - s->count) & mask) * s->count_ms * NS_PER_MS;
        s->count = counts[i];
        out_ns[i] = (int64_t)s->device_ns;
        s->offset_ns = fmin(s->offset_ns, (double)now_ns - s->device_ns);
    }
    for (int i = 0; i < n; i++)
        out_ns[i] += (int64_t)s->offset_ns;
    s->is_counting = (double)(now_ns - out_ns[n - 1]) < late_ns;
}

void hid_stamps_of(struct hid_stamps *s, const uint32_t *counts, int n, int64_t now_ns,
                   int64_t *out_ns) {
    learn_interval(s, n, now_ns);
    if (counts)
        follow_counts(s, counts, n, now_ns, out_ns);
    else
        spread(s, n, now_ns, out_ns);
    for (int i = 0; i < n; i++) {
        if (out_ns[i] < s->last_ns + apart_ns)
            out_ns[i] = s->last_ns + apart_ns;
        s->last_ns = out_ns[i];
    }
    s->arrival_ns = now_ns;
}
