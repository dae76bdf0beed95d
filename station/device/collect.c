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

// The newest time that every channel tells of. It does not go back.
static int64_t common_time(struct runner *r, int64_t now_ns) {
    int64_t common_ns = INT64_MAX;
    for (int i = 0; i < r->count; i++) {
        struct device *d = &r->devices[i];
        pthread_mutex_lock(&d->lock);
        runner_age_slots(d, now_ns);
        for (int k = 0; k < d->slot_count; k++) {
            int64_t told_ns = slot_told_ns(&d->slots[k], now_ns);
            common_ns = told_ns < common_ns ? told_ns : common_ns;
        }
        pthread_mutex_unlock(&d->lock);
    }
    return common_ns < r->common_ns && r->common_ns <= now_ns ? r->common_ns : common_ns;
}

static void add(struct runner *r, const struct slot *slot, int64_t common_ns, struct frame *frame) {
    struct sample before, *sample = &frame->samples[frame->count++];
    *sample = slot->newest;
    if (slot->validity == VALIDITY_OK && sample->time_ns > common_ns &&
        past_at(&slot->past, common_ns, &before)) {
        r->alignment_ms =
            fmax(r->alignment_ms, (double)(sample->time_ns - before.time_ns) / NS_PER_MS);
        *sample = before;
    }
    sample->validity = slot->validity;
}

static void fill(struct runner *r, int64_t now_ns, int64_t common_ns, struct frame *frame) {
    for (int i = 0; i < r->count; i++) {
        struct device *d = &r->devices[i];
        pthread_mutex_lock(&d->lock);
        runner_age_slots(d, now_ns);
        for (int k = 0; k < d->slot_count; k++) {
            CHECK(frame->count < FRAME_SAMPLES_MAX);
            add(r, &d->slots[k], common_ns, frame);
        }
        pthread_mutex_unlock(&d->lock);
    }
}

void runner_newest(struct runner *r, int64_t now_ns, struct frame *frame) {
    fill(r, now_ns, INT64_MAX, frame);
}

void runner_collect(struct runner *r, int64_t now_ns, struct frame *frame) {
    r->common_ns = common_time(r, now_ns);
    r->alignment_ms = 0;
    fill(r, now_ns, r->common_ns, frame);
}

double runner_alignment_ms(const struct runner *runner) {
    return runner->alignment_ms;
}
