// From the devices' newest samples to a frame of one time.
#include "base/check.h"
#include "base/clock.h"
#include "samples/runner_parts.h"

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

// A source that is much slower than the fastest tracker keeps its own time: it would hold all
// others back.
#define SLOWER 1.5

static bool is_slow(const struct runner *r, const struct slot *slot) {
    return slot_pace_ns(slot) > SLOWER * r->pace_ns;
}

static void note_pace(const struct slot *slot, double *pace_ns) {
    double pace = slot_pace_ns(slot);
    if (slot->newest.kind == SAMPLE_POSE && slot->validity == VALIDITY_OK && pace > 0)
        *pace_ns = fmin(*pace_ns, pace);
}

// The newest time that every channel tells of, the slow ones aside. It does not go back.
static int64_t common_time(struct runner *r, int64_t now_ns) {
    int64_t common_ns = INT64_MAX;
    double pace_ns = INFINITY;
    for (int i = 0; i < r->count; i++) {
        struct device *d = &r->devices[i];
        pthread_mutex_lock(&d->lock);
        runner_age_slots(d, now_ns);
        for (int k = 0; k < d->slot_count; k++) {
            int64_t told_ns = slot_told_ns(&d->slots[k], now_ns);
            note_pace(&d->slots[k], &pace_ns);
            if (!is_slow(r, &d->slots[k]))
                common_ns = told_ns < common_ns ? told_ns : common_ns;
        }
        pthread_mutex_unlock(&d->lock);
    }
    r->pace_ns = pace_ns;
    return common_ns < r->common_ns && r->common_ns <= now_ns ? r->common_ns : common_ns;
}

static struct sample *joint_in(struct frame *frame) {
    for (int i = 0; i < frame->count; i++)
        if (frame->samples[i].kind == SAMPLE_JOINT)
            return &frame->samples[i];
    return NULL;
}

// Of several devices each gives some of the joint's values. The joint has the time of its flexion.
static void merge_joint(const struct sample *part, uint8_t values, struct sample *joint) {
    double *const to[] = {&joint->joint.flexion_deg,  &joint->joint.varus_deg,
                          &joint->joint.internal_deg, &joint->joint.shift_mm,
                          &joint->joint.drawer_mm,    &joint->joint.distraction_mm};
    const double from[] = {part->joint.flexion_deg,  part->joint.varus_deg,
                           part->joint.internal_deg, part->joint.shift_mm,
                           part->joint.drawer_mm,    part->joint.distraction_mm};
    for (size_t i = 0; i < sizeof to / sizeof *to; i++)
        if (values >> i & 1)
            *to[i] = from[i];
    if (values & 1) {
        joint->time_ns = part->time_ns;
        joint->device = part->device;
    }
    if (part->validity > joint->validity)
        joint->validity = part->validity;
    if (part->filter_latency_us > joint->filter_latency_us) {
        joint->filter = part->filter;
        joint->filter_latency_us = part->filter_latency_us;
    }
}

static void add(struct runner *r, const struct device *d, const struct slot *slot,
                int64_t common_ns, struct frame *frame) {
    struct sample before, sample = slot->newest, *joint = joint_in(frame);
    if (slot->validity == VALIDITY_OK && sample.time_ns > common_ns &&
        past_at(&slot->past, common_ns, &before)) {
        r->alignment_ms =
            fmax(r->alignment_ms, (double)(sample.time_ns - before.time_ns) / NS_PER_MS);
        sample = before;
    }
    sample.validity = slot->validity;
    if (joint && sample.kind == SAMPLE_JOINT) {
        merge_joint(&sample, d->joint_values, joint);
        return;
    }
    CHECK(frame->count < FRAME_SAMPLES_MAX);
    frame->samples[frame->count++] = sample;
}

static void fill(struct runner *r, int64_t now_ns, int64_t common_ns, struct frame *frame) {
    for (int i = 0; i < r->count; i++) {
        struct device *d = &r->devices[i];
        pthread_mutex_lock(&d->lock);
        runner_age_slots(d, now_ns);
        for (int k = 0; k < d->slot_count; k++)
            add(r, d, &d->slots[k], common_ns, frame);
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
