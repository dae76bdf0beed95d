#include "base/sample.h"

#include "base/check.h"

#include <math.h>
#include <string.h>

static const char *const reserved_names[CHANNEL_COUNT] = {
    [CHANNEL_JOINT] = "joint",
    [CHANNEL_FEMUR] = "femur",
    [CHANNEL_TIBIA] = "tibia",
    [CHANNEL_PATELLA] = "patella",
    [CHANNEL_PROBE] = "probe",
    [CHANNEL_PUNCH] = "punch",
    [CHANNEL_SHAVER] = "shaver",
    [CHANNEL_KNIFE] = "knife",
    [CHANNEL_SCOPE] = "scope",
    [CHANNEL_FIRST_DESCRIBED] = "instrument_6",
    [CHANNEL_FIRST_DESCRIBED + 1] = "instrument_7",
    [CHANNEL_LAST_DESCRIBED] = "instrument_8",
};

#define DESCRIBED (CHANNEL_COUNT - CHANNEL_FIRST_DESCRIBED)

static char given_names[DESCRIBED][CHANNEL_NAME_MAX]; // empty: none

const char *channel_name(enum channel channel) {
    if ((unsigned)channel >= CHANNEL_COUNT)
        return "unknown";
    if (channel >= CHANNEL_FIRST_DESCRIBED && given_names[channel - CHANNEL_FIRST_DESCRIBED][0])
        return given_names[channel - CHANNEL_FIRST_DESCRIBED];
    return reserved_names[channel];
}

void channel_set_name(enum channel channel, const char *name) {
    CHECK(channel >= CHANNEL_FIRST_DESCRIBED && channel < CHANNEL_COUNT);
    CHECK(strlen(name) < CHANNEL_NAME_MAX);
    strcpy(given_names[channel - CHANNEL_FIRST_DESCRIBED], name);
}

bool channel_from_name(const char *name, enum channel *out_channel) {
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (!strcmp(name, channel_name((enum channel)i))) {
            *out_channel = (enum channel)i;
            return true;
        }
    return false;
}

bool channel_is_reserved(const char *name) {
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (!strcmp(name, reserved_names[i]))
            return true;
    return false;
}

const char *validity_name(enum validity validity) {
    static const char *const names[VALIDITY_COUNT] = {"ok", "held", "lost"};
    return (unsigned)validity < VALIDITY_COUNT ? names[validity] : "unknown";
}

static bool within(double value, double limit) {
    return fabs(value) <= limit; // false for NaN
}

static bool joint_is_valid(const struct joint_angles *a) {
    return within(a->flexion_deg, 180) && within(a->varus_deg, 180) &&
           within(a->internal_deg, 180) && within(a->shift_mm, 1e4) && within(a->drawer_mm, 1e4) &&
           within(a->distraction_mm, 1e4);
}

static bool body_is_valid(pose p) {
    vec3 t = p.translation;
    return pose_is_valid(p) && within(t.x, 1e4) && within(t.y, 1e4) && within(t.z, 1e4);
}

static bool sample_is_valid(const struct sample *s) {
    if ((unsigned)s->channel >= CHANNEL_COUNT || (unsigned)s->validity >= VALIDITY_COUNT ||
        s->filter >= FILTER_KIND_COUNT)
        return false;
    if ((s->kind == SAMPLE_JOINT) != (s->channel == CHANNEL_JOINT))
        return false;
    switch (s->kind) {
    case SAMPLE_JOINT:
        return joint_is_valid(&s->joint);
    case SAMPLE_POSE:
        return body_is_valid(s->T_mockup_body);
    case SAMPLE_HANDLE:
        return s->channel >= CHANNEL_FIRST_INSTRUMENT && s->handle.opening >= 0 &&
               s->handle.opening <= 1;
    case SAMPLE_FORCE:
        return within(s->force_n, FORCE_MAX_N);
    default:
        return false;
    }
}

bool frame_is_valid(const struct frame *frame) {
    if (frame->count < 0 || frame->count > FRAME_SAMPLES_MAX)
        return false;
    for (int i = 0; i < frame->count; i++)
        if (!sample_is_valid(&frame->samples[i]))
            return false;
    return true;
}
