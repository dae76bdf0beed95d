#include "wire/wire.h"

#include "base/check.h"

#include <math.h>
#include <pb_decode.h>
#include <pb_encode.h>
#include <string.h>

_Static_assert(CHANNEL_JOINT == 0 && CHANNEL_PATELLA == 3 && CHANNEL_PROBE == 4 &&
                   CHANNEL_SCOPE == 8 && CHANNEL_FIRST_DESCRIBED == 9,
               "channels have the numbers that the schema reserves");
_Static_assert((int)_arthron_Instrument_Kind_ARRAYSIZE == INSTRUMENT_KIND_COUNT &&
                   (int)arthron_Instrument_Kind_OPTIC == INSTRUMENT_OPTIC,
               "kinds on the wire are those of base/instrument.h");
_Static_assert(sizeof((arthron_Hello){0}.instruments) / sizeof(arthron_Instrument) ==
                       INSTRUMENTS_DESCRIBED_MAX &&
                   sizeof((arthron_LiveSession){0}.instruments) / sizeof(arthron_Instrument) ==
                       INSTRUMENT_COUNT &&
                   sizeof((arthron_Reply){0}.instruments) / sizeof(arthron_WarpedInstrument) ==
                       WIRE_REPLY_INSTRUMENTS &&
                   sizeof((arthron_Reply){0}.loose) / sizeof(arthron_CarriedLoose) ==
                       WIRE_REPLY_LOOSE &&
                   sizeof((arthron_View){0}.loose) / sizeof(arthron_ViewLoose) == WIRE_LOOSE_MAX,
               "as many instruments and loose bodies as the schema has room for");
_Static_assert((int)_arthron_Validity_ARRAYSIZE == VALIDITY_COUNT &&
                   (int)arthron_Validity_HELD == VALIDITY_HELD,
               "validities on the wire are those of base/sample.h");
_Static_assert((int)_arthron_AvatarMode_ARRAYSIZE == AVATAR_MODE_COUNT &&
                   (int)arthron_AvatarMode_POINTS == AVATAR_POINTS &&
                   (int)arthron_AvatarMode_RIGID == AVATAR_RIGID,
               "modes on the wire are those of base/extrapolation.h");
_Static_assert(sizeof((arthron_Frame){0}.samples) / sizeof(arthron_Sample) == FRAME_SAMPLES_MAX,
               "a whole frame goes on the wire");
_Static_assert((int)arthron_Knee_Side_LEFT == (int)SIDE_LEFT &&
                   sizeof((arthron_Knee){0}.patella) / sizeof(arthron_PatellaKey) ==
                       PATELLA_KEYS_MAX,
               "sides and keys of the schema are those of base/joint.h");
_Static_assert(sizeof((arthron_Hello){0}.devices) / sizeof(arthron_Device) == WIRE_DEVICES_MAX,
               "every device can be named in Hello");
_Static_assert(arthron_Control_size <= WIRE_CONTROL_MAX &&
                   arthron_Console_size <= WIRE_CONSOLE_MAX && arthron_Page_size <= WIRE_PAGE_MAX,
               "every message of ours is within its limit");

#define REPEATED_OVERHEAD 2 // tag and length
#define VIEW_GOALS_SIZE                                                                            \
    (sizeof((arthron_ViewAttempt){0}.goals) / sizeof(arthron_AttemptGoal) *                        \
     (arthron_AttemptGoal_size + REPEATED_OVERHEAD))
#define VIEW_ERRORS_SIZE                                                                           \
    (sizeof((arthron_ViewAttempt){0}.errors) / sizeof(arthron_AttemptError) *                      \
     (arthron_AttemptError_size + REPEATED_OVERHEAD))

_Static_assert(arthron_View_size - VIEW_GOALS_SIZE - VIEW_ERRORS_SIZE <= WIRE_VIEW_MAX,
               "a View without goals and errors is within its limit");

#define CONTROL_CHUNK_TAG 15 // of mesh_chunk in Control
#define CHUNK_OVERHEAD 4

_Static_assert(arthron_MeshChunk_size + CHUNK_OVERHEAD <= WIRE_CHUNK_MAX,
               "every chunk is within its limit");
_Static_assert(sizeof((arthron_MeshChunk){0}.data.bytes) == WIRE_CHUNK_DATA &&
                   sizeof((arthron_MeshAsk){0}.have) / sizeof(arthron_MeshState) ==
                       WIRE_MESH_GROUPS_MAX,
               "chunks and groups of the schema are those of wire.h");

// ---- encoding -----------------------------------------------------------------------------------

static enum result encode_control(const pb_msgdesc_t *kind, const void *message, uint8_t *data,
                                  size_t size, size_t *out_used) {
    pb_ostream_t stream = pb_ostream_from_buffer(data, size);
    if (!pb_encode(&stream, kind, message))
        return RESULT_LIMIT;
    *out_used = stream.bytes_written;
    return RESULT_OK;
}

enum result wire_encode_control(const arthron_Control *message, uint8_t *data, size_t size,
                                size_t *out_used) {
    return encode_control(arthron_Control_fields, message, data, size, out_used);
}

enum result wire_encode_console(const arthron_Console *message, uint8_t *data, size_t size,
                                size_t *out_used) {
    return encode_control(arthron_Console_fields, message, data, size, out_used);
}

enum result wire_encode_frame(const arthron_Frame *message, uint8_t *data, size_t size,
                              size_t *out_used) {
    return encode_control(arthron_Frame_fields, message, data, size, out_used);
}

enum result wire_encode_view(const arthron_View *message, uint8_t *data, size_t size,
                             size_t *out_used) {
    return encode_control(arthron_View_fields, message, data, size, out_used);
}

// ---- what nanopb does not check -----------------------------------------------------------------

// A value that cannot be in an enum of `count` values from 0: nanopb takes any 32 bits.
static enum result enum_check(const char *field, int value, int count, struct error *err) {
    if (value >= 0 && value < count)
        return RESULT_OK;
    return fail(err, RESULT_FORMAT, "%s is %d, not known", field, value);
}

static enum result frame_check(const arthron_Frame *m, struct error *err) {
    for (int i = 0; i < m->samples_count; i++) {
        const arthron_Sample *s = &m->samples[i];
        enum result result = enum_check("channel", (int)s->channel, CHANNEL_COUNT, err);
        if (result == RESULT_OK)
            result = enum_check("validity", (int)s->validity, _arthron_Validity_ARRAYSIZE, err);
        if (result != RESULT_OK)
            return fail_in(err, result, "sample %d: ", i);
    }
    return RESULT_OK;
}

// Rows and columns of the slopes that travel.
struct slope_shape {
    int rows, columns;
};

static struct slope_shape slope_shape(enum avatar_mode mode) {
    static const struct slope_shape shapes[AVATAR_MODE_COUNT] = {{3, 3}, {3, 6}, {4, 6}};
    return shapes[mode];
}

static bool floats_are_finite(const float *values, int count) {
    for (int i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

static enum result lead_check(const arthron_Lead *m, struct error *err) {
    enum result result = enum_check("mode", (int)m->mode, _arthron_AvatarMode_ARRAYSIZE, err);
    if (result != RESULT_OK)
        return result;
    struct slope_shape shape = slope_shape((enum avatar_mode)m->mode);
    int portal = m->mode == arthron_AvatarMode_RIGID ? 3 : 0;
    if (m->portal_count != portal || m->v_count != 3 ||
        m->slope_count != shape.rows * shape.columns)
        return fail(err, RESULT_FORMAT, "portal %d, v %d and slope %d are not those of %s",
                    m->portal_count, m->v_count, m->slope_count,
                    avatar_mode_name((enum avatar_mode)m->mode));
    if (!floats_are_finite(m->portal, portal) || !floats_are_finite(m->v, 3) ||
        !floats_are_finite(m->slope, m->slope_count) || !isfinite(m->s) ||
        !(m->reach_mm >= 0 && isfinite(m->reach_mm)))
        return fail(err, RESULT_FORMAT, "a value is not finite, or reach is negative");
    return RESULT_OK;
}

static enum result instrument_check(const arthron_WarpedInstrument *m, struct error *err) {
    enum result result = enum_check("channel", (int)m->channel, CHANNEL_COUNT, err);
    if (result == RESULT_OK)
        result = enum_check("validity", (int)m->validity, _arthron_Validity_ARRAYSIZE, err);
    if (result == RESULT_OK)
        result = enum_check("body", (int)m->body, _arthron_Body_ARRAYSIZE, err);
    if (result != RESULT_OK)
        return result;
    if (m->channel < CHANNEL_FIRST_INSTRUMENT)
        return fail(err, RESULT_FORMAT, "channel is %s, not an instrument",
                    channel_name((enum channel)m->channel));
    if (m->validity == arthron_Validity_LOST)
        return RESULT_OK;
    if (!m->has_pose || !pose_is_valid(wire_pose_to(&m->pose)))
        return fail(err, RESULT_FORMAT, "pose is not one");
    if (!(m->trust_radius_mm >= 0) || isnan(m->nearest_mm))
        return fail(err, RESULT_FORMAT, "trust radius or distance is not one");
    if (!m->has_lead || lead_check(&m->lead, err) != RESULT_OK)
        return m->has_lead ? fail_in(err, RESULT_FORMAT, "lead: ")
                           : fail(err, RESULT_FORMAT, "there is no lead");
    return RESULT_OK;
}

static enum result correction_check(const arthron_Correction *m, struct error *err) {
    enum result result = enum_check("body", (int)m->body, _arthron_Body_ARRAYSIZE, err);
    if (result == RESULT_OK && (!m->has_correction || !pose_is_valid(wire_pose_to(&m->correction))))
        return fail(err, RESULT_FORMAT, "correction is no pose");
    return result;
}

static enum result loose_check(const arthron_CarriedLoose *m, struct error *err) {
    const arthron_ShortPose *p = &m->pose;
    bool lies = m->state == arthron_LooseMoment_State_LYING;
    enum result result = enum_check("number", (int)m->number, WIRE_LOOSE_MAX, err);
    if (result == RESULT_OK)
        result = enum_check("state", (int)m->state, _arthron_LooseMoment_State_ARRAYSIZE, err);
    if (result == RESULT_OK)
        result = enum_check("on", (int)m->on, lies ? _arthron_Body_ARRAYSIZE : CHANNEL_COUNT, err);
    if (result != RESULT_OK || m->state == arthron_LooseMoment_State_OUT)
        return result;
    if (!lies && m->on < CHANNEL_FIRST_INSTRUMENT)
        return fail(err, RESULT_FORMAT, "it is held by no instrument");
    if (!m->has_pose || p->q_count != 4 || p->t_count != 3 || !pose_is_valid(wire_short_pose_to(p)))
        return fail(err, RESULT_FORMAT, "pose is not one");
    return RESULT_OK;
}

static enum result reply_check(const arthron_Reply *m, struct error *err) {
    enum result result = enum_check("state", (int)m->state, _arthron_SessionState_ARRAYSIZE, err);
    for (int i = 0; result == RESULT_OK && i < m->instruments_count; i++) {
        result = instrument_check(&m->instruments[i], err);
        if (result != RESULT_OK)
            return fail_in(err, result, "instrument %d: ", i);
    }
    for (int i = 0; result == RESULT_OK && i < m->corrections_count; i++) {
        result = correction_check(&m->corrections[i], err);
        if (result != RESULT_OK)
            return fail_in(err, result, "correction %d: ", i);
    }
    for (int i = 0; result == RESULT_OK && i < m->loose_count; i++) {
        result = loose_check(&m->loose[i], err);
        if (result != RESULT_OK)
            return fail_in(err, result, "loose body %d: ", i);
    }
    return result;
}

static enum result hello_check(const arthron_Hello *m, struct error *err) {
    const arthron_Calibration *c = &m->calibration;
    struct instruments all;
    if (wire_instruments_to(m, &all, err) != RESULT_OK)
        return RESULT_FORMAT;
    if (!m->has_calibration || (c->residual_mm >= 0 && isfinite(c->residual_mm) &&
                                c->residual_deg >= 0 && isfinite(c->residual_deg)))
        return RESULT_OK;
    return fail(err, RESULT_FORMAT, "calibration: a residual is not one");
}

static enum result patella_check(const arthron_Knee *m, struct error *err) {
    for (int i = 0; i < m->patella_count; i++) {
        const arthron_PatellaKey *key = &m->patella[i];
        if (!isfinite(key->flexion_deg) || !key->has_pose ||
            !pose_is_valid(wire_pose_to(&key->pose)))
            return fail(err, RESULT_FORMAT, "patella %d: not a flexion and a pose", i);
        if (i > 0 && !(key->flexion_deg > m->patella[i - 1].flexion_deg))
            return fail(err, RESULT_FORMAT, "patella %d: its flexion does not rise", i);
    }
    return RESULT_OK;
}

static enum result change_check(const arthron_SessionChange *m, struct error *err) {
    const arthron_Knee *knee = &m->knee;
    enum result result = enum_check("state", (int)m->state, _arthron_SessionState_ARRAYSIZE, err);
    if (result != RESULT_OK || !m->has_knee)
        return result;
    result = enum_check("side", (int)knee->side, _arthron_Knee_Side_ARRAYSIZE, err);
    if (result != RESULT_OK)
        return result;
    if (!knee->has_femur_joint || !pose_is_valid(wire_pose_to(&knee->femur_joint)) ||
        !knee->has_tibia_joint || !pose_is_valid(wire_pose_to(&knee->tibia_joint)))
        return fail(err, RESULT_FORMAT, "knee: a joint's frame is no pose");
    return patella_check(knee, err);
}

static enum result attempt_check(const arthron_AttemptState *m, struct error *err) {
    if (enum_check("purpose", (int)m->purpose, _arthron_AttemptState_Purpose_ARRAYSIZE, err) ||
        enum_check("hand", (int)m->hand, _arthron_AttemptState_Hand_ARRAYSIZE, err) ||
        enum_check("end", (int)m->end, _arthron_AttemptState_End_ARRAYSIZE, err) ||
        enum_check("verdict", (int)m->verdict, _arthron_AttemptState_Verdict_ARRAYSIZE, err))
        return RESULT_FORMAT;
    for (int i = 0; i < m->occurrences_count; i++)
        if (m->occurrences[i].error >= m->errors_count)
            return fail(err, RESULT_FORMAT, "occurrence %d: of no error of the task", i);
    return isfinite(m->limit_s) && isfinite(m->pass_time_s)
               ? RESULT_OK
               : fail(err, RESULT_FORMAT, "a time is no number");
}

static enum result control_check(arthron_Control *m, struct error *err) {
    switch (m->which_message) {
    case arthron_Control_hello_tag:
        return hello_check(&m->message.hello, err);
    case arthron_Control_frame_tag:
        return frame_check(&m->message.frame, err);
    case arthron_Control_marker_tag:
        return wire_marker_to(&m->message.marker, &(struct marker){0}, err);
    case arthron_Control_reply_tag:
        return reply_check(&m->message.reply, err);
    case arthron_Control_welcome_tag:
        return enum_check("state", (int)m->message.welcome.state, _arthron_SessionState_ARRAYSIZE,
                          err);
    case arthron_Control_session_change_tag:
        return change_check(&m->message.session_change, err);
    case arthron_Control_attempt_tag:
        return attempt_check(&m->message.attempt, err);
    case arthron_Control_refusal_tag:
        // A reason of a later version is still a refusal.
        if ((unsigned)m->message.refusal.reason >= _arthron_Refusal_Reason_ARRAYSIZE)
            m->message.refusal.reason = arthron_Refusal_Reason_UNKNOWN;
        return RESULT_OK;
    default:
        return RESULT_OK;
    }
}

static enum result reading_check(const arthron_JointReading *m, struct error *err) {
    const arthron_Joint *j = &m->joint;
    if (!m->has_joint || !isfinite(j->flexion_deg) || !isfinite(j->varus_deg) ||
        !isfinite(j->internal_deg) || !isfinite(j->shift_mm) || !isfinite(j->drawer_mm) ||
        !isfinite(j->distraction_mm) || !m->has_pose || !pose_is_valid(wire_pose_to(&m->pose)))
        return fail(err, RESULT_FORMAT, "joint: no pose");
    return enum_check("joint: validity", (int)m->validity, _arthron_Validity_ARRAYSIZE, err);
}

static enum result command_check(const arthron_Command *m, struct error *err) {
    if (enum_check("kind", (int)m->kind, _arthron_Command_Kind_ARRAYSIZE, err) != RESULT_OK ||
        enum_check("purpose", (int)m->purpose, _arthron_AttemptState_Purpose_ARRAYSIZE, err) !=
            RESULT_OK ||
        enum_check("hand", (int)m->hand, _arthron_AttemptState_Hand_ARRAYSIZE, err) != RESULT_OK)
        return RESULT_FORMAT;
    return enum_check("remark: body", (int)m->remark.body, _arthron_Body_ARRAYSIZE, err);
}

static enum result console_check(const arthron_Console *m, struct error *err) {
    if (m->which_message == arthron_Console_command_tag)
        return command_check(&m->message.command, err);
    if (m->which_message != arthron_Console_command_reply_tag)
        return RESULT_OK;
    const arthron_CommandReply *reply = &m->message.command_reply;
    for (int i = 0; i < reply->sessions_count; i++)
        if (enum_check("state", (int)reply->sessions[i].state, _arthron_SessionState_ARRAYSIZE,
                       err) != RESULT_OK)
            return fail_in(err, RESULT_FORMAT, "session %d: ", i);
    return reply->has_joint ? reading_check(&reply->joint, err) : RESULT_OK;
}

static enum result page_check(const arthron_Page *m, struct error *err) {
    if (m->which_message == arthron_Page_command_tag)
        return command_check(&m->message.command, err);
    if (m->which_message == arthron_Page_watch_tag)
        return enum_check("what", (int)m->message.watch.what, _arthron_Watch_What_ARRAYSIZE, err);
    return RESULT_OK;
}

// ---- decoding -----------------------------------------------------------------------------------

static enum result decode(const char *name, const pb_msgdesc_t *kind, const uint8_t *data,
                          size_t size, size_t largest, void *out_message, struct error *err) {
    if (size > largest)
        return fail(err, RESULT_LIMIT, "%s: %zu bytes, at most %zu are accepted", name, size,
                    largest);
    pb_istream_t stream = pb_istream_from_buffer(data, size);
    if (!pb_decode(&stream, kind, out_message))
        return fail(err, RESULT_FORMAT, "%s: %s", name, PB_GET_ERROR(&stream));
    return RESULT_OK;
}

enum result wire_decode_control(const uint8_t *data, size_t size, arthron_Control *out_message,
                                struct error *err) {
    enum result result = decode("control message", arthron_Control_fields, data, size,
                                WIRE_CONTROL_MAX, out_message, err);
    if (result == RESULT_OK && wire_is_chunk(data, size))
        return fail(err, RESULT_FORMAT, "control message: a piece of a mesh is not for here");
    if (result == RESULT_OK && control_check(out_message, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "control message: ");
    return result;
}

enum result wire_decode_console(const uint8_t *data, size_t size, arthron_Console *out_message,
                                struct error *err) {
    enum result result = decode("console message", arthron_Console_fields, data, size,
                                WIRE_CONSOLE_MAX, out_message, err);
    if (result == RESULT_OK && console_check(out_message, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "console message: ");
    return result;
}

enum result wire_decode_frame(const uint8_t *data, size_t size, arthron_Frame *out_message,
                              struct error *err) {
    enum result result =
        decode("frame", arthron_Frame_fields, data, size, WIRE_DATAGRAM_MAX, out_message, err);
    if (result == RESULT_OK && frame_check(out_message, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "frame: ");
    return result;
}

enum result wire_decode_reply(const uint8_t *data, size_t size, arthron_Reply *out_message,
                              struct error *err) {
    enum result result =
        decode("reply", arthron_Reply_fields, data, size, WIRE_DATAGRAM_MAX, out_message, err);
    if (result == RESULT_OK && reply_check(out_message, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "reply: ");
    return result;
}

enum result wire_decode_page(const uint8_t *data, size_t size, arthron_Page *out_message,
                             struct error *err) {
    enum result result =
        decode("page's message", arthron_Page_fields, data, size, WIRE_PAGE_MAX, out_message, err);
    if (result == RESULT_OK && page_check(out_message, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "page's message: ");
    return result;
}

// ---- pieces of meshes ---------------------------------------------------------------------------

enum result wire_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used) {
    pb_ostream_t stream = pb_ostream_from_buffer(data, size);
    if (!pb_encode_tag(&stream, PB_WT_STRING, CONTROL_CHUNK_TAG) ||
        !pb_encode_submessage(&stream, arthron_MeshChunk_fields, chunk))
        return RESULT_LIMIT;
    *out_used = stream.bytes_written;
    return RESULT_OK;
}

bool wire_is_chunk(const uint8_t *data, size_t size) {
    return size > 0 && data[0] == (CONTROL_CHUNK_TAG << 3 | PB_WT_STRING);
}

static bool decode_chunk(pb_istream_t *stream, arthron_MeshChunk *out_chunk) {
    pb_istream_t inner;
    pb_wire_type_t type;
    uint32_t tag;
    bool end;
    return pb_decode_tag(stream, &type, &tag, &end) && pb_make_string_substream(stream, &inner) &&
           pb_decode(&inner, arthron_MeshChunk_fields, out_chunk) &&
           pb_close_string_substream(stream, &inner);
}

static enum result chunk_check(const arthron_MeshChunk *m, struct error *err) {
    if (!m->group[0])
        return fail(err, RESULT_FORMAT, "its group has no name");
    if (m->number <= m->base)
        return fail(err, RESULT_FORMAT, "number %u is not above base %u", m->number, m->base);
    if (m->size == 0 || m->size > WIRE_MESH_MAX)
        return fail(err, RESULT_LIMIT, "%u bytes, 1 to %u are accepted", m->size, WIRE_MESH_MAX);
    if (m->index > (m->size - 1) / WIRE_CHUNK_DATA)
        return fail(err, RESULT_FORMAT, "piece %u of %u bytes", m->index, m->size);
    uint32_t left = m->size - m->index * WIRE_CHUNK_DATA;
    uint32_t due = left < WIRE_CHUNK_DATA ? left : WIRE_CHUNK_DATA;
    if (m->data.size != due)
        return fail(err, RESULT_FORMAT, "piece %u has %u bytes, not %u", m->index, m->data.size,
                    due);
    return RESULT_OK;
}

enum result wire_decode_chunk(const uint8_t *data, size_t size, arthron_MeshChunk *out_chunk,
                              struct error *err) {
    if (size > WIRE_CHUNK_MAX)
        return fail(err, RESULT_LIMIT, "piece of a mesh: %zu bytes, at most %d are accepted", size,
                    WIRE_CHUNK_MAX);
    CHECK(wire_is_chunk(data, size));
    pb_istream_t stream = pb_istream_from_buffer(data, size);
    if (!decode_chunk(&stream, out_chunk))
        return fail(err, RESULT_FORMAT, "piece of a mesh: %s", PB_GET_ERROR(&stream));
    if (stream.bytes_left)
        return fail(err, RESULT_FORMAT, "piece of a mesh: %zu bytes behind it", stream.bytes_left);
    enum result result = chunk_check(out_chunk, err);
    return result == RESULT_OK ? result : fail_in(err, result, "piece of a mesh: ");
}

// ---- leads --------------------------------------------------------------------------------------

static void floats_from(vec3 v, float out[3]) {
    out[0] = (float)v.x;
    out[1] = (float)v.y;
    out[2] = (float)v.z;
}

static vec3 floats_to(const float v[3]) {
    return (vec3){v[0], v[1], v[2]};
}

void wire_extrapolation_from(const struct avatar_extrapolation *extrapolation,
                             arthron_WarpedInstrument *out) {
    struct slope_shape shape = slope_shape(extrapolation->mode);
    arthron_Lead *m = &out->lead;
    *m = (arthron_Lead){.mode = (arthron_AvatarMode)extrapolation->mode, .v_count = 3};
    floats_from(extrapolation->motion.v, m->v);
    if (extrapolation->mode == AVATAR_RIGID) {
        m->portal_count = 3;
        floats_from(extrapolation->portal, m->portal);
        m->s = (float)extrapolation->motion.s;
    }
    for (int i = 0; i < shape.rows; i++)
        for (int k = 0; k < shape.columns; k++)
            m->slope[m->slope_count++] = (float)extrapolation->slope[i][k];
    m->reach_mm = (float)extrapolation->reach_mm;
    out->has_lead = true;
    out->trust_radius_mm = (float)extrapolation->trust_radius_mm;
}

struct avatar_extrapolation wire_extrapolation_to(const arthron_WarpedInstrument *instrument) {
    const arthron_Lead *m = &instrument->lead;
    struct avatar_extrapolation extrapolation = {.mode = (enum avatar_mode)m->mode,
                                                 .portal = floats_to(m->portal),
                                                 .motion = {floats_to(m->v), m->s},
                                                 .reach_mm = m->reach_mm,
                                                 .trust_radius_mm = instrument->trust_radius_mm};
    struct slope_shape shape = slope_shape(extrapolation.mode);
    for (int i = 0; i < shape.rows; i++)
        for (int k = 0; k < shape.columns; k++)
            extrapolation.slope[i][k] = m->slope[i * shape.columns + k];
    return extrapolation;
}
