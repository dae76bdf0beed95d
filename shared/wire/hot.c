// The two messages of every pose, read and written without a table of fields: nanopb takes four
// times as long. The bytes are nanopb's own (tests/wire/hot.c).
#include "base/check.h"
#include "wire/wire.h"

#include <string.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "values are copied as they lie");

// The types of protobuf's encoding.
enum { VARINT = 0, FIXED64 = 1, BYTES = 2, FIXED32 = 5 };
#define TAG(field, type) ((uint8_t)((field) << 3 | (type)))

// ---- writing ------------------------------------------------------------------------------------

// Writes from the end to the start, so that a length is known when its turn comes.
struct back_writer {
    uint8_t *at;
};

static void put_bytes(struct back_writer *w, const void *data, size_t size) {
    w->at -= size;
    memcpy(w->at, data, size);
}

static void put_byte(struct back_writer *w, uint8_t byte) {
    *--w->at = byte;
}

static void put_varint(struct back_writer *w, uint32_t value) {
    uint8_t bytes[5];
    size_t count = 0;
    for (; value >= 0x80; value >>= 7)
        bytes[count++] = (uint8_t)(value | 0x80);
    bytes[count++] = (uint8_t)value;
    put_bytes(w, bytes, count);
}

static void put_number(struct back_writer *w, int field, uint32_t value) {
    put_varint(w, value);
    put_byte(w, TAG(field, VARINT));
}

static void put_fixed64(struct back_writer *w, int field, const void *value) {
    put_bytes(w, value, 8);
    put_byte(w, TAG(field, FIXED64));
}

static void put_fixed32(struct back_writer *w, int field, const void *value) {
    put_bytes(w, value, 4);
    put_byte(w, TAG(field, FIXED32));
}

// A field that is 0 bit for bit is left out: -0.0 is not.
static void put_some_number(struct back_writer *w, int field, uint32_t value) {
    if (value)
        put_number(w, field, value);
}

static void put_some64(struct back_writer *w, int field, const void *value) {
    if (memcmp(value, (uint8_t[8]){0}, 8) != 0)
        put_fixed64(w, field, value);
}

static void put_some32(struct back_writer *w, int field, const void *value) {
    if (memcmp(value, (uint8_t[4]){0}, 4) != 0)
        put_fixed32(w, field, value);
}

// What was written since `end` becomes a field.
static void put_length(struct back_writer *w, int field, const uint8_t *end) {
    put_varint(w, (uint32_t)(end - w->at));
    put_byte(w, TAG(field, BYTES));
}

static void put_floats(struct back_writer *w, int field, const float *values, int count) {
    const uint8_t *end = w->at;
    if (!count)
        return;
    put_bytes(w, values, (size_t)count * sizeof *values);
    put_length(w, field, end);
}

static void put_pose(struct back_writer *w, int field, const arthron_Pose *m) {
    const double *const parts[] = {&m->qw, &m->qx, &m->qy, &m->qz, &m->x, &m->y, &m->z};
    const uint8_t *end = w->at;
    for (int i = 7; i > 0; i--)
        put_some64(w, i, parts[i - 1]);
    put_length(w, field, end);
}

static void put_lead(struct back_writer *w, int field, const arthron_Lead *m) {
    const uint8_t *end = w->at;
    put_some32(w, arthron_Lead_reach_mm_tag, &m->reach_mm);
    put_floats(w, arthron_Lead_slope_tag, m->slope, m->slope_count);
    put_some32(w, arthron_Lead_s_tag, &m->s);
    put_floats(w, arthron_Lead_v_tag, m->v, m->v_count);
    put_floats(w, arthron_Lead_portal_tag, m->portal, m->portal_count);
    put_some_number(w, arthron_Lead_mode_tag, m->mode);
    put_length(w, field, end);
}

static void put_instrument(struct back_writer *w, const arthron_WarpedInstrument *m) {
    const uint8_t *end = w->at;
    if (m->has_lead)
        put_lead(w, arthron_WarpedInstrument_lead_tag, &m->lead);
    put_some32(w, arthron_WarpedInstrument_nearest_mm_tag, &m->nearest_mm);
    put_some32(w, arthron_WarpedInstrument_trust_radius_mm_tag, &m->trust_radius_mm);
    if (m->has_pose)
        put_pose(w, arthron_WarpedInstrument_pose_tag, &m->pose);
    put_some_number(w, arthron_WarpedInstrument_body_tag, m->body);
    put_some_number(w, arthron_WarpedInstrument_validity_tag, m->validity);
    put_some_number(w, arthron_WarpedInstrument_channel_tag, m->channel);
    put_length(w, arthron_Reply_instruments_tag, end);
}

static void put_correction(struct back_writer *w, const arthron_Correction *m) {
    const uint8_t *end = w->at;
    if (m->has_correction)
        put_pose(w, arthron_Correction_correction_tag, &m->correction);
    put_some_number(w, arthron_Correction_body_tag, m->body);
    put_length(w, arthron_Reply_corrections_tag, end);
}

static void put_short_pose(struct back_writer *w, int field, const arthron_ShortPose *m) {
    const uint8_t *end = w->at;
    put_floats(w, arthron_ShortPose_t_tag, m->t, m->t_count);
    put_floats(w, arthron_ShortPose_q_tag, m->q, m->q_count);
    put_length(w, field, end);
}

static void put_loose(struct back_writer *w, const arthron_CarriedLoose *m) {
    const uint8_t *end = w->at;
    if (m->has_pose)
        put_short_pose(w, arthron_CarriedLoose_pose_tag, &m->pose);
    put_some_number(w, arthron_CarriedLoose_on_tag, m->on);
    put_some_number(w, arthron_CarriedLoose_state_tag, m->state);
    put_some_number(w, arthron_CarriedLoose_number_tag, m->number);
    put_length(w, arthron_Reply_loose_tag, end);
}

static void put_event_counts(struct back_writer *w, const arthron_Reply *m) {
    const uint8_t *end = w->at;
    for (int i = m->event_counts_count; i > 0; i--)
        put_varint(w, m->event_counts[i - 1]);
    if (m->event_counts_count)
        put_length(w, arthron_Reply_event_counts_tag, end);
}

static void put_reply(struct back_writer *w, const arthron_Reply *m) {
    for (int i = m->loose_count; i > 0; i--)
        put_loose(w, &m->loose[i - 1]);
    if (m->has_frames_late)
        put_number(w, arthron_Reply_frames_late_tag, m->frames_late);
    if (m->has_frames_lost)
        put_number(w, arthron_Reply_frames_lost_tag, m->frames_lost);
    put_some64(w, arthron_Reply_path_challenge_tag, &m->path_challenge);
    put_event_counts(w, m);
    for (int i = m->corrections_count; i > 0; i--)
        put_correction(w, &m->corrections[i - 1]);
    put_some32(w, arthron_Reply_events_tag, &m->events);
    for (int i = m->instruments_count; i > 0; i--)
        put_instrument(w, &m->instruments[i - 1]);
    put_some_number(w, arthron_Reply_state_tag, m->state);
    put_some64(w, arthron_Reply_frame_time_ns_tag, &m->frame_time_ns);
    put_some64(w, arthron_Reply_frame_number_tag, &m->frame_number);
}

enum result wire_encode_reply(const arthron_Reply *message, uint8_t *data, size_t size,
                              size_t *out_used) {
    uint8_t whole[arthron_Reply_size];
    struct back_writer w = {whole + sizeof whole};
    put_reply(&w, message);
    size_t used = (size_t)(whole + sizeof whole - w.at);
    if (used > size)
        return RESULT_LIMIT;
    memcpy(data, w.at, used);
    *out_used = used;
    return RESULT_OK;
}

// ---- reading ------------------------------------------------------------------------------------

// Fields as every encoder writes them: in the order of their numbers, each once, lengths and counts
// in as few bytes as they need. Whatever else the format allows is left to nanopb.
struct plain_reader {
    const uint8_t *at, *end;
};

static bool next_is(struct plain_reader *r, uint8_t tag) {
    if (r->at == r->end || *r->at != tag)
        return false;
    r->at++;
    return true;
}

static bool get_bytes(struct plain_reader *r, void *out, size_t size) {
    if ((size_t)(r->end - r->at) < size)
        return false;
    memcpy(out, r->at, size);
    r->at += size;
    return true;
}

// Below 128.
static bool get_small(struct plain_reader *r, uint32_t *out) {
    if (r->at == r->end || *r->at >= 0x80)
        return false;
    *out = *r->at++;
    return true;
}

// Below 2^21.
static bool get_number(struct plain_reader *r, uint32_t *out) {
    uint32_t value = 0;
    for (int shift = 0; shift < 21 && r->at < r->end; shift += 7) {
        uint8_t byte = *r->at++;
        value |= (uint32_t)(byte & 0x7f) << shift;
        if (byte < 0x80) {
            *out = value;
            return true;
        }
    }
    return false;
}

static bool get_part(struct plain_reader *r, uint32_t size, struct plain_reader *out) {
    if ((size_t)(r->end - r->at) < size)
        return false;
    *out = (struct plain_reader){r->at, r->at + size};
    r->at += size;
    return true;
}

// A message of reals alone. Those that are left out are 0, as they are already.
static bool get_reals(struct plain_reader *r, double *out, int count) {
    struct plain_reader part;
    uint32_t size;
    if (!get_small(r, &size) || !get_part(r, size, &part))
        return false;
    for (int i = 0; i < count; i++)
        if (next_is(&part, TAG(i + 1, FIXED64)) && !get_bytes(&part, &out[i], 8))
            return false;
    return part.at == part.end;
}

static bool get_joint(struct plain_reader *r, struct sample *out) {
    double parts[6] = {0};
    out->kind = SAMPLE_JOINT;
    if (!get_reals(r, parts, 6))
        return false;
    out->joint = (struct joint_angles){parts[0], parts[1], parts[2], parts[3], parts[4], parts[5]};
    return true;
}

static bool get_pose(struct plain_reader *r, struct sample *out) {
    double parts[7] = {0};
    out->kind = SAMPLE_POSE;
    if (!get_reals(r, parts, 7))
        return false;
    out->T_mockup_body =
        (pose){{parts[0], parts[1], parts[2], parts[3]}, {parts[4], parts[5], parts[6]}};
    return true;
}

static bool get_handle(struct plain_reader *r, struct sample *out) {
    struct plain_reader part;
    uint32_t size;
    out->kind = SAMPLE_HANDLE;
    if (!get_small(r, &size) || !get_part(r, size, &part))
        return false;
    if (next_is(&part, TAG(arthron_Handle_opening_tag, FIXED64)) &&
        !get_bytes(&part, &out->handle.opening, 8))
        return false;
    if (next_is(&part, TAG(arthron_Handle_buttons_tag, FIXED32)) &&
        !get_bytes(&part, &out->handle.buttons, 4))
        return false;
    return part.at == part.end;
}

static bool get_filter(struct plain_reader *r, struct sample *out) {
    uint32_t latency_us;
    if (!next_is(r, TAG(arthron_Sample_one_euro_us_tag, VARINT)))
        return true;
    if (!get_number(r, &latency_us) || latency_us > UINT16_MAX)
        return false;
    out->filter = FILTER_ONE_EURO;
    out->filter_latency_us = (uint16_t)latency_us;
    return true;
}

static bool get_value(struct plain_reader *r, struct sample *out) {
    if (next_is(r, TAG(arthron_Sample_joint_tag, BYTES)))
        return get_joint(r, out) && get_filter(r, out);
    if (next_is(r, TAG(arthron_Sample_pose_tag, BYTES)))
        return get_pose(r, out) && get_filter(r, out);
    if (next_is(r, TAG(arthron_Sample_handle_tag, BYTES)))
        return get_handle(r, out) && get_filter(r, out);
    out->kind = SAMPLE_FORCE;
    return get_filter(r, out) && next_is(r, TAG(arthron_Sample_force_n_tag, FIXED64)) &&
           get_bytes(r, &out->force_n, 8);
}

// A number that may be left out, below `bound`.
static bool get_below(struct plain_reader *r, int field, uint32_t bound, uint32_t *out) {
    *out = 0;
    return !next_is(r, TAG(field, VARINT)) || (get_small(r, out) && *out < bound);
}

static bool get_sample(struct plain_reader *r, struct sample *out) {
    uint32_t channel, validity, device;
    if (!get_below(r, arthron_Sample_channel_tag, CHANNEL_COUNT, &channel) ||
        !get_below(r, arthron_Sample_validity_tag, VALIDITY_COUNT, &validity) ||
        !get_below(r, arthron_Sample_device_tag, WIRE_DEVICES_MAX, &device))
        return false;
    *out = (struct sample){.channel = (enum channel)channel,
                           .validity = (enum validity)validity,
                           .device = (uint8_t)device};
    if (next_is(r, TAG(arthron_Sample_time_ns_tag, FIXED64)) && !get_bytes(r, &out->time_ns, 8))
        return false;
    return get_value(r, out) && r->at == r->end;
}

static bool get_samples(struct plain_reader *r, struct frame *out) {
    struct plain_reader part;
    uint32_t size;
    for (out->count = 0; next_is(r, TAG(arthron_Frame_samples_tag, BYTES)); out->count++)
        if (out->count == FRAME_SAMPLES_MAX || !get_small(r, &size) || !get_part(r, size, &part) ||
            !get_sample(&part, &out->samples[out->count]))
            return false;
    return true;
}

static bool skip_padding(struct plain_reader *r) {
    struct plain_reader part;
    uint32_t size;
    return !next_is(r, TAG(arthron_Frame_padding_tag, BYTES)) ||
           (get_number(r, &size) && size <= sizeof((arthron_Frame){0}.padding.bytes) &&
            get_part(r, size, &part));
}

static bool get_frame(struct plain_reader *r, struct frame *out) {
    return next_is(r, TAG(arthron_Frame_number_tag, FIXED64)) && get_bytes(r, &out->number, 8) &&
           next_is(r, TAG(arthron_Frame_time_ns_tag, FIXED64)) && get_bytes(r, &out->time_ns, 8) &&
           get_samples(r, out) && skip_padding(r) && r->at == r->end;
}

enum result wire_read_frame(const uint8_t *data, size_t size, struct frame *out,
                            struct error *err) {
    struct plain_reader r = {data, data + size};
    if (size <= WIRE_DATAGRAM_MAX && get_frame(&r, out) && wire_frame_is_sane(out))
        return RESULT_OK;
    arthron_Frame message;
    enum result result = wire_decode_frame(data, size, &message, err);
    return result == RESULT_OK ? wire_frame_to(&message, out, err) : result;
}
