// Messages as the plain types of base, and back.
#include "base/check.h"
#include "wire/wire.h"

#include <string.h>

arthron_Pose wire_pose_from(pose p) {
    quat q = p.rotation;
    vec3 t = p.translation;
    return (arthron_Pose){q.w, q.x, q.y, q.z, t.x, t.y, t.z};
}

pose wire_pose_to(const arthron_Pose *m) {
    return (pose){{m->qw, m->qx, m->qy, m->qz}, {m->x, m->y, m->z}};
}

arthron_ShortPose wire_short_pose_from(pose p) {
    quat q = p.rotation;
    vec3 t = p.translation;
    return (arthron_ShortPose){.q_count = 4,
                               .q = {(float)q.w, (float)q.x, (float)q.y, (float)q.z},
                               .t_count = 3,
                               .t = {(float)t.x, (float)t.y, (float)t.z}};
}

pose wire_short_pose_to(const arthron_ShortPose *m) {
    return (pose){{m->q[0], m->q[1], m->q[2], m->q[3]}, {m->t[0], m->t[1], m->t[2]}};
}

arthron_Joint wire_joint_from(const struct joint_angles *a) {
    return (arthron_Joint){a->flexion_deg, a->varus_deg, a->internal_deg,
                           a->shift_mm,    a->drawer_mm, a->distraction_mm};
}

struct joint_angles wire_joint_to(const arthron_Joint *m) {
    return (struct joint_angles){m->flexion_deg, m->varus_deg, m->internal_deg,
                                 m->shift_mm,    m->drawer_mm, m->distraction_mm};
}

static void sample_from(const struct sample *s, arthron_Sample *out) {
    out->channel = (uint8_t)s->channel;
    out->validity = (arthron_Validity)s->validity;
    out->device = s->device;
    out->time_ns = s->time_ns;
    if (s->filter == FILTER_ONE_EURO) {
        out->which_filter = arthron_Sample_one_euro_us_tag;
        out->filter.one_euro_us = s->filter_latency_us;
    }
    switch (s->kind) {
    case SAMPLE_JOINT:
        out->which_value = arthron_Sample_joint_tag;
        out->value.joint = wire_joint_from(&s->joint);
        break;
    case SAMPLE_POSE:
        out->which_value = arthron_Sample_pose_tag;
        out->value.pose = wire_pose_from(s->T_mockup_body);
        break;
    case SAMPLE_FORCE:
        out->which_value = arthron_Sample_force_n_tag;
        out->value.force_n = s->force_n;
        break;
    default:
        out->which_value = arthron_Sample_handle_tag;
        out->value.handle = (arthron_Handle){s->handle.opening, s->handle.buttons};
    }
}

void wire_frame_from(const struct frame *frame, arthron_Frame *out) {
    memset(out, 0, sizeof *out);
    out->number = frame->number;
    out->time_ns = frame->time_ns;
    out->samples_count = (pb_size_t)frame->count;
    for (int i = 0; i < frame->count; i++)
        sample_from(&frame->samples[i], &out->samples[i]);
}

static bool sample_to(const arthron_Sample *m, struct sample *out) {
    if (m->device >= WIRE_DEVICES_MAX)
        return false;
    out->channel = (enum channel)m->channel;
    out->validity = (enum validity)m->validity;
    out->device = (uint8_t)m->device;
    out->time_ns = m->time_ns;
    if (m->which_filter == arthron_Sample_one_euro_us_tag) {
        out->filter = FILTER_ONE_EURO;
        out->filter_latency_us = m->filter.one_euro_us;
    }
    switch (m->which_value) {
    case arthron_Sample_joint_tag:
        out->kind = SAMPLE_JOINT;
        out->joint = wire_joint_to(&m->value.joint);
        return true;
    case arthron_Sample_pose_tag:
        out->kind = SAMPLE_POSE;
        out->T_mockup_body = wire_pose_to(&m->value.pose);
        return true;
    case arthron_Sample_handle_tag:
        out->kind = SAMPLE_HANDLE;
        out->handle = (struct handle){m->value.handle.opening, m->value.handle.buttons};
        return true;
    case arthron_Sample_force_n_tag:
        out->kind = SAMPLE_FORCE;
        out->force_n = m->value.force_n;
        return true;
    default:
        return false;
    }
}

// So that adding the offset between two clocks cannot overflow.
static bool is_sane_time(int64_t time_ns) {
    return time_ns >= 0 && time_ns < WIRE_TIME_MAX_NS;
}

static bool times_are_sane(const struct frame *frame) {
    for (int i = 0; i < frame->count; i++)
        if (!is_sane_time(frame->samples[i].time_ns))
            return false;
    return is_sane_time(frame->time_ns);
}

bool wire_frame_is_sane(const struct frame *frame) {
    return times_are_sane(frame) && frame_is_valid(frame);
}

enum result wire_frame_to(const arthron_Frame *m, struct frame *out, struct error *err) {
    *out = (struct frame){.number = m->number, .time_ns = m->time_ns, .count = m->samples_count};
    CHECK(out->count <= FRAME_SAMPLES_MAX);
    for (int i = 0; i < out->count; i++)
        if (!sample_to(&m->samples[i], &out->samples[i]))
            return fail(err, RESULT_INVALID, "frame %llu: sample %d has no known value or device",
                        (unsigned long long)m->number, i);
    if (!times_are_sane(out))
        return fail(err, RESULT_INVALID, "frame %llu: a time is negative or centuries ahead",
                    (unsigned long long)m->number);
    if (!frame_is_valid(out))
        return fail(err, RESULT_INVALID, "frame %llu: a sample is out of its range",
                    (unsigned long long)m->number);
    return RESULT_OK;
}

bool wire_frame_reduce(arthron_Frame *m, bool instruments, bool force) {
    pb_size_t kept = 0;
    bool all = true;
    for (pb_size_t i = 0; i < m->samples_count; i++) {
        const arthron_Sample *s = &m->samples[i];
        if (!instruments && s->channel >= CHANNEL_FIRST_DESCRIBED)
            continue;
        bool is_taken = force || (s->which_value != arthron_Sample_force_n_tag &&
                                  kept < WIRE_SAMPLES_WITHOUT_FORCE);
        if (is_taken)
            m->samples[kept++] = *s;
        all &= is_taken;
    }
    m->samples_count = kept;
    return all;
}

// ---- instruments --------------------------------------------------------------------------------

void wire_instrument_from(const struct instruments *instruments, int index,
                          arthron_Instrument *out) {
    const struct instrument *one = &instruments->of[index];
    *out = (arthron_Instrument){
        .channel = (uint8_t)(CHANNEL_FIRST_INSTRUMENT + index),
        .kind = (arthron_Instrument_Kind)one->kind,
        .cuts = one->cuts,
        .has_button = one->button >= 0,
        .button = one->button >= 0 ? (uint32_t)one->button : 0,
        .length_mm = one->length_mm,
        .width_mm = one->width_mm,
        .thickness_mm = one->thickness_mm,
        .opening_deg = one->opening_deg,
        .has_colour = one->colour != INSTRUMENT_PLAIN,
        .colour = one->colour != INSTRUMENT_PLAIN ? one->colour : 0,
    };
    memcpy(out->name, one->name, sizeof out->name);
}

void wire_session_instruments_from(const struct instruments *instruments,
                                   arthron_LiveSession *out) {
    out->instruments_count = (pb_size_t)instruments->count;
    for (int i = 0; i < instruments->count; i++)
        wire_instrument_from(instruments, i, &out->instruments[i]);
}

_Static_assert(sizeof((arthron_Instrument *)0)->name == INSTRUMENT_NAME_MAX, "a name fits");

static struct instrument instrument_to(const arthron_Instrument *m) {
    struct instrument one = {
        .kind = (enum instrument_kind)m->kind,
        .cuts = m->cuts,
        .button = !m->has_button    ? -1
                  : m->button <= 31 ? (int)m->button
                                    : 32,
        .length_mm = m->length_mm,
        .width_mm = m->width_mm,
        .thickness_mm = m->thickness_mm,
        .opening_deg = m->opening_deg,
        .colour = !m->has_colour                 ? INSTRUMENT_PLAIN
                  : m->colour < INSTRUMENT_PLAIN ? m->colour
                                                 : 1u << 24,
    };
    memcpy(one.name, m->name, sizeof one.name);
    return one;
}

enum result wire_instruments_to(const arthron_Hello *m, struct instruments *out,
                                struct error *err) {
    *out = *instruments_usual();
    for (int i = 0; i < m->instruments_count; i++) {
        struct instrument one = instrument_to(&m->instruments[i]);
        if (m->instruments[i].channel != CHANNEL_FIRST_DESCRIBED + i)
            return fail(err, RESULT_INVALID, "instrument %d has the channel %d, not %d", i,
                        m->instruments[i].channel, CHANNEL_FIRST_DESCRIBED + i);
        if (instruments_add(out, &one, err) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}

// ---- knees --------------------------------------------------------------------------------------

void wire_knee_from(const struct knee_frame *knee, arthron_Knee *out) {
    *out = (arthron_Knee){.side = (arthron_Knee_Side)knee->joint.side,
                          .has_femur_joint = true,
                          .femur_joint = wire_pose_from(knee->joint.T_femur_joint),
                          .has_tibia_joint = true,
                          .tibia_joint = wire_pose_from(knee->joint.T_tibia_joint),
                          .patella_count = (pb_size_t)knee->patella_count};
    for (int i = 0; i < knee->patella_count; i++) {
        const struct patella_key *key = &knee->patella[i];
        out->patella[i] =
            (arthron_PatellaKey){key->flexion_deg, true, wire_pose_from(key->T_femur_patella)};
    }
}

void wire_knee_to(const arthron_Knee *m, struct knee_frame *out) {
    *out = (struct knee_frame){.joint = {.side = (enum side)m->side,
                                         .T_femur_joint = wire_pose_to(&m->femur_joint),
                                         .T_tibia_joint = wire_pose_to(&m->tibia_joint)},
                               .patella_count = m->patella_count};
    for (int i = 0; i < out->patella_count; i++)
        out->patella[i] =
            (struct patella_key){m->patella[i].flexion_deg, wire_pose_to(&m->patella[i].pose)};
}

// ---- markers ------------------------------------------------------------------------------------

_Static_assert(sizeof((arthron_Marker){0}.name) == MARKER_TEXT_MAX &&
                   sizeof((arthron_Marker){0}.device) == MARKER_TEXT_MAX,
               "texts of a marker on the wire are those of base/marker.h");

arthron_Marker wire_marker_from(const struct marker *marker) {
    arthron_Marker out = {
        .number = marker->number, .time_ns = marker->time_ns, .value = marker->value};
    memcpy(out.name, marker->name, sizeof out.name);
    memcpy(out.device, marker->device, sizeof out.device);
    return out;
}

enum result wire_marker_to(const arthron_Marker *m, struct marker *out, struct error *err) {
    *out = (struct marker){.number = m->number, .time_ns = m->time_ns, .value = m->value};
    memcpy(out->name, m->name, sizeof out->name);
    memcpy(out->device, m->device, sizeof out->device);
    if (!marker_is_valid(out) || m->time_ns < 0 || m->time_ns >= WIRE_TIME_MAX_NS)
        return fail(err, RESULT_FORMAT,
                    "marker: its name, device, number, value or time is not one");
    return RESULT_OK;
}
