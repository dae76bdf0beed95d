// From the devices' newest samples to a frame of one time.
#include "base/check.h"
#include "base/clock.h"
#include "device/runner_parts.h"

#include <math.h>

struct slot *runner_slot(struct device *d, const struct sample *sample) {
    for (int i = 0; i < d->slot_count; i++)
        if (d->slots[i].newest.channel == sample->channel &&
            d->slots[i].newest.kind == sample->kind)
            return &d->slots[i];
    CHECK(!"a driver gave a sample that its outputs do not name");
    return NULL;
}

void runner_age_slots(struct device *d, int64_t now_ns) {
    for (int i = 0; i < d->slot_count; i++)
        d->status.losses += slot_age(&d->slots[i], now_ns);
}

void runner_newest(struct runner *r, int64_t now_ns, struct frame *frame) {
    for (int i = 0; i < r->count; i++) {
        struct device *d = &r->devices[i];
        pthread_mutex_lock(&d->lock);
        runner_age_slots(d, now_ns);
        for (int k = 0; k < d->slot_count; k++) {
            CHECK(frame->count < FRAME_SAMPLES_MAX);
            struct sample *sample = &frame->samples[frame->count++];
            *sample = d->slots[k].newest;
            sample->validity = d->slots[k].validity;
        }
        pthread_mutex_unlock(&d->lock);
    }
}

static bool is_aligned(const struct sample *sample) {
    return sample->validity == VALIDITY_OK && sample->kind != SAMPLE_HANDLE;
}

// The newest time that every channel has a value of. It does not go back.
static int64_t common_time(const struct runner *r, int64_t now_ns, const struct frame *frame) {
    int64_t common_ns = INT64_MAX;
    for (int i = 0; i < frame->count; i++)
        if (is_aligned(&frame->samples[i]) && frame->samples[i].time_ns < common_ns)
            common_ns = frame->samples[i].time_ns;
    return common_ns < r->common_ns && r->common_ns <= now_ns ? r->common_ns : common_ns;
}

static void take_back(struct runner *r, int device, struct sample *sample) {
    struct device *d = &r->devices[device];
    struct sample before;
    pthread_mutex_lock(&d->lock);
    bool found = past_at(&runner_slot(d, sample)->past, r->common_ns, &before);
    pthread_mutex_unlock(&d->lock);
    if (!found)
        return;
    r->alignment_ms = fmax(r->alignment_ms, (double)(sample->time_ns - before.time_ns) / NS_PER_MS);
    before.validity = sample->validity;
    *sample = before;
}

void runner_collect(struct runner *r, int64_t now_ns, struct frame *frame) {
    CHECK(!frame->count);
    runner_newest(r, now_ns, frame);
    r->common_ns = common_time(r, now_ns, frame);
    r->alignment_ms = 0;
    for (int i = 0; i < frame->count; i++)
        if (is_aligned(&frame->samples[i]) && frame->samples[i].time_ns > r->common_ns)
            take_back(r, frame->samples[i].device, &frame->samples[i]);
}

double runner_alignment_ms(const struct runner *runner) {
    return runner->alignment_ms;
}
