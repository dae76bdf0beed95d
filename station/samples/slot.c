#include "samples/slot.h"

#include "base/clock.h"

#include <math.h>

#define CLOCK_BACK_NS (50 * NS_PER_MS) // no value was measured so long after now

static const int64_t longest_silence_ns = NS_PER_S;

// A source's pauses beyond this are pauses, not its rate.
static const double longest_interval_ns = 250e6;
static const double longest_pack_ns = 100e6; // what is longer was a stall

void slot_init(struct slot *slot, enum channel channel, enum sample_kind kind, uint8_t device,
               double hold_ms, double jump_mm) {
    *slot = (struct slot){.hold_ns = (int64_t)(hold_ms * NS_PER_MS), .validity = VALIDITY_LOST};
    slot->newest = (struct sample){.channel = channel, .kind = kind, .device = device};
    if (kind == SAMPLE_POSE)
        slot->newest.T_mockup_body = pose_identity();
    guard_init(&slot->guard, kind == SAMPLE_JOINT ? &guard_joint : &guard_hand, jump_mm,
               SLOT_JUMP_DEG);
    slot->noise_mm = SLOT_NOISE_MM;
    slot->noise_deg = SLOT_NOISE_DEG;
}

static bool is_sane(const struct slot *slot, const struct sample *sample) {
    struct frame frame = {.count = 1};
    frame.samples[0] = *sample;
    return frame_is_valid(&frame) && sample->time_ns > slot->newest.time_ns;
}

// A joint's angles as if they were the body's: how far it turned is how far they changed.
static pose pose_of(const struct sample *s) {
    if (s->kind == SAMPLE_POSE)
        return s->T_mockup_body;
    const struct joint_angles *a = &s->joint;
    quat flexion = quat_from_axis_angle((vec3){1, 0, 0}, a->flexion_deg * RAD_PER_DEG);
    quat varus = quat_from_axis_angle((vec3){0, 1, 0}, a->varus_deg * RAD_PER_DEG);
    quat internal = quat_from_axis_angle((vec3){0, 0, 1}, a->internal_deg * RAD_PER_DEG);
    return (pose){quat_multiply(flexion, quat_multiply(varus, internal)),
                  {a->shift_mm, a->drawer_mm, a->distraction_mm}};
}

// What lies so far from the newest value is no noise about it.
static const double leap_mm = 50, leap_deg = 45;

static bool leaps(const struct slot *slot, pose p) {
    pose newest = pose_of(&slot->newest);
    return vec3_distance(p.translation, newest.translation) > leap_mm ||
           quat_angle(p.rotation, newest.rotation) > leap_deg * RAD_PER_DEG;
}

// What a body could not have done. Noise is judged by what is caught, too: what the guard takes of
// it is calm.
static enum slot_verdict judge_motion(struct slot *slot, const struct sample *sample) {
    if (!sample_kind_is_motion(sample->kind))
        return SLOT_USED;
    pose p = pose_of(sample);
    bool taken = guard_takes(&slot->guard, sample->time_ns, p);
    if (!taken && leaps(slot, p))
        return SLOT_JUMP;
    if (noise_is_high(&slot->noise, slot->noise_mm, slot->noise_deg, sample->time_ns, p))
        return SLOT_NOISY;
    return taken ? SLOT_USED : SLOT_JUMP;
}

static void fall_silent(struct slot *slot, int64_t time_ns) {
    if (time_ns < slot->newest.time_ns)
        time_ns = slot->newest.time_ns;
    if (time_ns < slot->silent_ns)
        slot->silent_ns = time_ns;
}

static void use(struct slot *slot, const struct sample *sample, int64_t arrival_ns) {
    double interval = (double)(sample->time_ns - slot->newest.time_ns);
    if (slot->newest.time_ns && interval < longest_interval_ns)
        slot->interval_ns += (slot->interval_ns ? 0.1 : 1) * (interval - slot->interval_ns);
    uint8_t device = slot->newest.device;
    slot->newest = *sample;
    slot->newest.device = device;
    filter_apply(&slot->filter, &slot->newest);
    past_add(&slot->past, &slot->newest);
    int64_t lag_ns = arrival_ns - sample->time_ns;
    slot->lag_ns = lag_ns > slot->lag_ns ? lag_ns : slot->lag_ns + (lag_ns - slot->lag_ns) / 64;
    double patience = slot->interval_ns ? 2 * slot->interval_ns : longest_interval_ns;
    slot->silent_ns = arrival_ns + (int64_t)patience;
    slot->validity = VALIDITY_OK;
}

enum slot_verdict slot_take(struct slot *slot, const struct sample *sample, int64_t arrival_ns) {
    enum slot_verdict verdict = SLOT_USED;
    if (sample->validity == VALIDITY_LOST)
        verdict = SLOT_SILENT;
    else if (!is_sane(slot, sample))
        verdict = SLOT_MALFORMED;
    else
        verdict = judge_motion(slot, sample);
    if (verdict == SLOT_USED)
        use(slot, sample, arrival_ns);
    else
        fall_silent(slot, arrival_ns);
    return verdict;
}

// A pack may come in two pieces: the gap before the first one counts, too.
void slot_arrived(struct slot *slot, int count, int64_t now_ns) {
    double gap_ns = slot->arrived_ns ? (double)(now_ns - slot->arrived_ns) : 0;
    double longer_ns = fmin(fmax(gap_ns, slot->gap_ns), longest_pack_ns);
    slot->pack_ns *= 0.9;
    if (count > 1 && longer_ns > slot->pack_ns)
        slot->pack_ns = longer_ns;
    slot->gap_ns = gap_ns;
    slot->arrived_ns = now_ns;
    int64_t patient_ns = now_ns + (int64_t)(2 * slot->pack_ns);
    if (slot->validity == VALIDITY_OK && patient_ns > slot->silent_ns)
        slot->silent_ns = patient_ns;
}

// What comes now is measured before what came: the clock went back.
static void begin_anew(struct slot *slot, int64_t now_ns) {
    slot->newest.time_ns = now_ns - (int64_t)fmax(2 * slot->interval_ns, NS_PER_MS);
    slot->silent_ns = now_ns;
    slot->filter.time_ns = 0;
    slot->noise = (struct noise){0};
    past_forget(&slot->past);
    guard_forget(&slot->guard);
}

bool slot_age(struct slot *slot, int64_t now_ns) {
    if (slot->newest.time_ns > now_ns + CLOCK_BACK_NS)
        begin_anew(slot, now_ns);
    if (slot->validity == VALIDITY_LOST || now_ns < slot->silent_ns)
        return false;
    slot->validity = VALIDITY_HELD;
    if (now_ns < slot->silent_ns + slot->hold_ns)
        return false;
    slot->validity = VALIDITY_LOST;
    if (!guard_is_catching(&slot->guard, now_ns))
        guard_forget(&slot->guard);
    return true;
}

int64_t slot_told_ns(const struct slot *slot, int64_t now_ns) {
    if (!sample_kind_is_motion(slot->newest.kind) || !slot->newest.time_ns ||
        now_ns > slot->silent_ns + slot->hold_ns + longest_silence_ns)
        return INT64_MAX;
    return slot->validity == VALIDITY_OK ? slot->newest.time_ns : now_ns - slot->lag_ns;
}

double slot_pace_ns(const struct slot *slot) {
    return fmax(slot->interval_ns, slot->pack_ns);
}
