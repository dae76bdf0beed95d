#include "device/slot.h"

#include "base/clock.h"

// A source's pauses beyond this are pauses, not its rate.
static const double longest_interval_ns = 250e6;

void slot_init(struct slot *slot, enum channel channel, enum sample_kind kind, uint8_t device,
               double hold_ms, double jump_mm) {
    *slot = (struct slot){.hold_ns = (int64_t)(hold_ms * NS_PER_MS), .validity = VALIDITY_LOST};
    slot->newest = (struct sample){.channel = channel, .kind = kind, .device = device};
    if (kind == SAMPLE_POSE)
        slot->newest.T_mockup_body = pose_identity();
    guard_init(&slot->guard, jump_mm);
}

static bool is_sane(const struct slot *slot, const struct sample *sample) {
    struct frame frame = {.count = 1};
    frame.samples[0] = *sample;
    return frame_is_valid(&frame) && sample->time_ns > slot->newest.time_ns;
}

static void fall_silent(struct slot *slot, int64_t time_ns) {
    if (time_ns < slot->newest.time_ns)
        time_ns = slot->newest.time_ns;
    if (time_ns < slot->silent_ns)
        slot->silent_ns = time_ns;
}

static void use(struct slot *slot, const struct sample *sample) {
    double interval = (double)(sample->time_ns - slot->newest.time_ns);
    if (slot->newest.time_ns && interval < longest_interval_ns)
        slot->interval_ns += (slot->interval_ns ? 0.1 : 1) * (interval - slot->interval_ns);
    uint8_t device = slot->newest.device;
    slot->newest = *sample;
    slot->newest.device = device;
    filter_apply(&slot->filter, &slot->newest);
    double patience = slot->interval_ns ? 2 * slot->interval_ns : longest_interval_ns;
    slot->silent_ns = sample->time_ns + (int64_t)patience;
    slot->validity = VALIDITY_OK;
}

enum slot_verdict slot_take(struct slot *slot, const struct sample *sample) {
    enum slot_verdict verdict = SLOT_USED;
    if (sample->validity == VALIDITY_LOST)
        verdict = SLOT_SILENT;
    else if (!is_sane(slot, sample))
        verdict = SLOT_MALFORMED;
    else if (sample->kind == SAMPLE_POSE &&
             !guard_takes(&slot->guard, sample->time_ns, sample->T_mockup_body))
        verdict = SLOT_JUMP;
    if (verdict == SLOT_USED)
        use(slot, sample);
    else
        fall_silent(slot, sample->time_ns);
    return verdict;
}

bool slot_age(struct slot *slot, int64_t now_ns) {
    if (slot->validity == VALIDITY_LOST || now_ns < slot->silent_ns)
        return false;
    slot->validity = VALIDITY_HELD;
    if (now_ns < slot->silent_ns + slot->hold_ns)
        return false;
    slot->validity = VALIDITY_LOST;
    guard_forget(&slot->guard);
    return true;
}
