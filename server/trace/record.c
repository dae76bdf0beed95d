#include "trace/record.h"

#include "base/bytes.h"
#include "base/check.h"
#include "step/digest.h"

#include <string.h>

// Version 4 has these, and these only: whoever adds a field, a channel or a body writes it here, in
// fields.c and in FORMAT.md, and raises TRACE_VERSION.
_Static_assert(CHANNEL_COUNT == 9 && INSTRUMENT_COUNT == 5 && BODY_COUNT == 3, "channels, bodies");
_Static_assert(FRAME_SAMPLES_MAX == 16 && sizeof(struct sample) == 80, "the sample");
_Static_assert(sizeof(struct instrument_output) == 592, "the output of an instrument");
_Static_assert(sizeof(struct job) == 160, "a job");
_Static_assert(sizeof(struct tissue_figures) == 336, "the figures of a tissue");
_Static_assert(sizeof(struct session_output) == 4048, "the output of a step");

enum {
    POSE_SIZE = 7 * 8,
    SAMPLE_SIZE_MAX = 4 + 8 + POSE_SIZE,
    INPUT_SIZE_MAX = 1 + 8 + 8 + 8 + 1 + FRAME_SAMPLES_MAX * SAMPLE_SIZE_MAX,
    LEAD_SIZE_MAX = 1 + 2 * 3 * 8 + 8 + 24 * 8 + 2 * 8,
    INSTRUMENT_SIZE_MAX =
        2 + 2 * POSE_SIZE + 3 * 8 + 9 * 8 + 8 + 4 + 8 + LEAD_SIZE_MAX + 7 * 8 + 8 + 4 + 1,
    BONES_SIZE_MAX = BODY_COUNT * (2 * POSE_SIZE + 1) + 1 + ADAPTIVE_LIGAMENTS_MAX * 2 * 8,
    JOB_SIZE_MAX = 8 + 3 + 4 + 2 * (POSE_SIZE + 8),
    LANDED_SIZE_MAX = 8 + 2 + sizeof(struct tissue_figures) + 8,
    OUTPUT_SIZE_MAX = 3 * 8 + 1 + 4 + 6 * 8 + 1 + BONES_SIZE_MAX +
                      INSTRUMENT_COUNT * INSTRUMENT_SIZE_MAX + JOB_SIZE_MAX + LANDED_SIZE_MAX + 8
};
_Static_assert(INPUT_SIZE_MAX + OUTPUT_SIZE_MAX <= RECORD_PAYLOAD_MAX, "a step fits");

// ---- what both ends have in common, one pair for each type

static void write_joint(struct writer *w, const struct joint_angles *a) {
    write_vec3(w, (vec3){a->flexion_deg, a->varus_deg, a->internal_deg});
    write_vec3(w, (vec3){a->shift_mm, a->drawer_mm, a->distraction_mm});
}

static struct joint_angles read_joint(struct reader *r) {
    vec3 angles = read_vec3(r), t = read_vec3(r);
    return (struct joint_angles){angles.x, angles.y, angles.z, t.x, t.y, t.z};
}

static void write_handle(struct writer *w, const struct handle *handle) {
    write_f64(w, handle->opening);
    write_u32(w, handle->buttons);
}

static struct handle read_handle(struct reader *r) {
    double opening = read_f64(r);
    return (struct handle){opening, read_u32(r)};
}

// ---- the input of a step

static void write_sample(struct writer *w, const struct sample *s) {
    write_u8(w, (uint8_t)s->channel);
    write_u8(w, (uint8_t)s->kind);
    write_u8(w, (uint8_t)s->validity);
    write_u8(w, s->device);
    write_i64(w, s->time_ns);
    switch (s->kind) {
    case SAMPLE_JOINT:
        write_joint(w, &s->joint);
        break;
    case SAMPLE_POSE:
        write_pose(w, s->T_mockup_body);
        break;
    default:
        write_handle(w, &s->handle);
    }
}

static void read_sample(struct reader *r, struct sample *out) {
    out->channel = read_u8(r);
    out->kind = read_u8(r);
    out->validity = read_u8(r);
    out->device = read_u8(r);
    out->time_ns = read_i64(r);
    switch (out->kind) {
    case SAMPLE_JOINT:
        out->joint = read_joint(r);
        break;
    case SAMPLE_POSE:
        out->T_mockup_body = read_pose(r);
        break;
    default:
        out->handle = read_handle(r);
    }
}

static void write_input(struct writer *w, const struct session_input *input, bool job_done) {
    write_u8(w, (uint8_t)input->kind);
    write_i64(w, input->time_ns);
    if (input->kind == INPUT_JOB) {
        write_u64(w, input->job);
        write_u8(w, job_done);
    }
    if (input->kind != INPUT_FRAME)
        return;
    CHECK(input->frame.count >= 0 && input->frame.count <= FRAME_SAMPLES_MAX);
    write_u64(w, input->frame.number);
    write_i64(w, input->frame.time_ns);
    write_u8(w, (uint8_t)input->frame.count);
    for (int i = 0; i < input->frame.count; i++)
        write_sample(w, &input->frame.samples[i]);
}

static bool read_job_input(struct reader *r, struct session_input *out, bool *out_job_done) {
    out->job = read_u64(r);
    unsigned done = read_u8(r);
    *out_job_done = done == 1;
    return done <= 1 && time_is_sane(out->time_ns);
}

// False where a session must not be given it.
static bool read_input(struct reader *r, struct session_input *out, bool *out_job_done) {
    out->kind = read_u8(r);
    out->time_ns = read_i64(r);
    if (out->kind == INPUT_JOB)
        return read_job_input(r, out, out_job_done);
    if (out->kind != INPUT_FRAME)
        return (unsigned)out->kind < INPUT_KIND_COUNT && time_is_sane(out->time_ns);
    out->frame.number = read_u64(r);
    out->frame.time_ns = read_i64(r);
    out->frame.count = read_u8(r);
    if (out->frame.count > FRAME_SAMPLES_MAX || !time_is_sane(out->frame.time_ns))
        return false;
    for (int i = 0; i < out->frame.count; i++) {
        read_sample(r, &out->frame.samples[i]);
        if (!time_is_sane(out->frame.samples[i].time_ns))
            return false;
    }
    return frame_is_valid(&out->frame) && time_is_sane(out->time_ns);
}

// ---- the output of a step

// That of `tip` is the space warp's.
static void lead_of_tip(const struct warp *warp, struct avatar_lead *out) {
    out->mode = AVATAR_TIP;
    out->motion.v = warp->displacement;
    for (int i = 0; i < 3; i++)
        memcpy(out->slope[i], warp->gradient.m[i], sizeof warp->gradient.m[i]);
    out->trust_radius_mm = warp->trust_radius_mm;
}

static bool read_lead(struct reader *r, const struct warp *warp, struct avatar_lead *out) {
    out->mode = read_u8(r);
    if (out->mode == AVATAR_TIP) {
        lead_of_tip(warp, out);
        return true;
    }
    out->portal = read_vec3(r);
    out->motion.v = read_vec3(r);
    out->motion.s = read_f64(r);
    for (int i = 0; i < 24; i++)
        out->slope[i / 6][i % 6] = read_f64(r);
    out->reach_mm = read_f64(r);
    out->trust_radius_mm = read_f64(r);
    return (unsigned)out->mode < AVATAR_MODE_COUNT;
}

static bool read_bones(struct reader *r, unsigned version, struct session_output *out) {
    bool good = true;
    for (int i = 0; i < BODY_COUNT; i++) {
        out->T_mockup_body[i] = out->T_mockup_virtual[i] = read_pose(r);
        unsigned elsewhere = version >= 3 ? read_u8(r) : 0;
        if (elsewhere)
            out->T_mockup_virtual[i] = read_pose(r);
        good = good && elsewhere <= 1;
    }
    out->torn_count = version >= 3 ? read_u8(r) : 0;
    if (out->torn_count > ADAPTIVE_LIGAMENTS_MAX)
        return false;
    for (int i = 0; i < out->torn_count; i++) {
        out->opening[i] = read_f64(r);
        out->share[i] = read_f64(r);
    }
    return good;
}

static bool read_follow(struct reader *r, struct instrument_output *out) {
    bool good = read_lead(r, &out->warp, &out->lead);
    out->penetration_mm = read_f64(r);
    out->tip_gap_mm = read_f64(r);
    out->discrepancy.offset_mm = read_f64(r);
    out->discrepancy.tilt_deg = read_f64(r);
    out->discrepancy.gain = read_f64(r);
    out->discrepancy.gain_least = read_f64(r);
    out->discrepancy.turn_deg = read_f64(r);
    return good;
}

// Version 2 had another gain in the place of all that.
static void skip_follow(struct reader *r, struct instrument_output *out) {
    read_f64(r);
    lead_of_tip(&out->warp, &out->lead);
}

static bool read_instrument(struct reader *r, unsigned version, struct instrument_output *out) {
    unsigned present = read_u8(r);
    out->present = present == 1;
    if (!out->present)
        return present == 0;
    out->validity = read_u8(r);
    out->T_mockup_tip = read_pose(r);
    out->T_mockup_warped = read_pose(r);
    out->warp.displacement = read_vec3(r);
    for (int i = 0; i < 9; i++)
        out->warp.gradient.m[i / 3][i % 3] = read_f64(r);
    out->warp.trust_radius_mm = read_f64(r);
    out->warp.nearest = (int32_t)read_u32(r);
    out->warp.nearest_mm = read_f64(r);
    bool good = true;
    if (version >= 3)
        good = read_follow(r, out);
    else
        skip_follow(r, out);
    out->handle = read_handle(r);
    out->handle_validity = read_u8(r);
    return good && (unsigned)out->validity < VALIDITY_COUNT &&
           (unsigned)out->handle_validity < VALIDITY_COUNT && out->warp.nearest >= -1 &&
           out->warp.nearest < WARP_SURFACES_MAX;
}

static bool read_job(struct reader *r, unsigned version, struct job *out) {
    out->id = read_u64(r);
    if (!out->id)
        return true;
    out->kind = read_u8(r);
    out->tissue = read_u8(r);
    if (out->kind == JOB_CUT) {
        out->stroke = version >= 4 ? read_u32(r) : 0;
        out->move.kind = read_u8(r);
        for (int i = 0; i < 2; i++) {
            out->move.T_mesh_tip[i] = read_pose(r);
            out->move.opening[i] = read_f64(r);
        }
    }
    return out->kind > JOB_NONE && (unsigned)out->kind < JOB_KIND_COUNT &&
           out->tissue < TISSUES_MAX && (unsigned)out->move.kind < BLADE_COUNT;
}

static void read_zones(struct reader *r, struct zone_volumes *out) {
    for (int i = 0; i < ZONE_ALONG_COUNT; i++)
        for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
            out->mm3[i][k] = read_f64(r);
}

static void read_figures(struct reader *r, struct tissue_figures *out) {
    out->mesh_number = read_u32(r);
    out->cuts = read_u32(r);
    out->refused = read_u32(r);
    out->pieces = read_u32(r);
    out->volume_mm3 = read_f64(r);
    out->removed_mm3 = read_f64(r);
    out->pieces_mm3 = read_f64(r);
    out->warped_mm3 = read_f64(r);
    out->left_mm3 = read_f64(r);
    out->distance_mm = read_f64(r);
    out->quality.removed_mm3 = read_f64(r);
    out->quality.planned_mm3 = read_f64(r);
    out->quality.over_mm3 = read_f64(r);
    out->quality.under_mm3 = read_f64(r);
    out->quality.damage_mm3 = read_f64(r);
    out->quality.rim_mm = read_f64(r);
    out->quality.step_mm = read_f64(r);
    read_zones(r, &out->quality.whole);
    read_zones(r, &out->quality.removed);
    read_zones(r, &out->quality.budget);
}

static bool read_landed(struct reader *r, struct landed *out) {
    out->job = read_u64(r);
    if (!out->job)
        return true;
    out->outcome = read_u8(r);
    out->tissue = read_u8(r);
    read_figures(r, &out->figures);
    out->hash = read_u64(r);
    return (unsigned)out->outcome < JOB_OUTCOME_COUNT && out->tissue < TISSUES_MAX;
}

static void write_output(struct writer *w, const struct session_output *out) {
    write_u64(w, out->step);
    write_u64(w, out->frame_number);
    write_i64(w, out->time_ns);
    write_u8(w, (uint8_t)out->state);
    write_u32(w, out->events);
    write_joint(w, &out->joint);
    write_u8(w, (uint8_t)out->joint_validity);
    digest_write_bones(w, out);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        digest_write_instrument(w, &out->instruments[i]);
    digest_write_job(w, &out->job);
    digest_write_landed(w, &out->landed);
    write_u64(w, out->hash);
}

static bool read_output(struct reader *r, unsigned version, struct session_output *out) {
    out->step = read_u64(r);
    out->frame_number = read_u64(r);
    out->time_ns = read_i64(r);
    out->state = read_u8(r);
    out->events = read_u32(r);
    out->joint = read_joint(r);
    out->joint_validity = read_u8(r);
    bool good = (unsigned)out->state < SESSION_STATE_COUNT &&
                (unsigned)out->joint_validity < VALIDITY_COUNT;
    good = read_bones(r, version, out) && good;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        good = read_instrument(r, version, &out->instruments[i]) && good;
    good = read_job(r, version, &out->job) && good;
    good = read_landed(r, &out->landed) && good;
    out->hash = read_u64(r);
    return good;
}

// ---- records

static struct writer begin_record(enum trace_record_type type, uint8_t *out) {
    struct writer w = {out, RECORD_MAX, 4, false};
    write_u8(&w, (uint8_t)type);
    return w;
}

static size_t end_record(struct writer *w, struct chain *chain) {
    struct writer prefix = {w->data, 4, 0, false};
    write_u32(&prefix, (uint32_t)(w->used - RECORD_PREFIX));
    chain_add(chain, w->data, w->used);
    write_bytes(w, chain->value, sizeof chain->value);
    CHECK(!w->overflow);
    return w->used;
}

size_t record_encode_step(const struct session_input *input, bool job_done,
                          const struct session_output *output, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_STEP, out);
    write_input(&w, input, job_done);
    write_output(&w, output);
    return end_record(&w, chain);
}

size_t record_encode_past(const struct session_input *input, bool job_done, struct chain *chain,
                          uint8_t *out) {
    struct writer w = begin_record(TRACE_PAST, out);
    write_input(&w, input, job_done);
    return end_record(&w, chain);
}

size_t record_encode_gap(uint64_t missing, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_GAP, out);
    write_u64(&w, missing);
    return end_record(&w, chain);
}

size_t record_encode_resume(int64_t utc_ns, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_RESUME, out);
    write_i64(&w, utc_ns);
    return end_record(&w, chain);
}

size_t record_encode_remark(const struct remark *remark, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_REMARK, out);
    write_u32(&w, remark->number);
    write_i64(&w, remark->time_ns);
    write_text(&w, remark->author);
    write_text(&w, remark->text);
    write_u8(&w, remark->withdrawn);
    write_u8(&w, remark->has_marker);
    write_u8(&w, (uint8_t)remark->body);
    write_vec3(&w, remark->point);
    return end_record(&w, chain);
}

static void write_block(struct writer *w, const uint8_t *data, size_t size) {
    write_u16(w, (uint16_t)size);
    write_bytes(w, data, size);
}

size_t record_encode_end(const struct trace_end *end, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_END, out);
    write_u64(&w, end->records);
    write_u64(&w, end->missing);
    write_block(&w, end->certificate, end->certificate_size);
    write_block(&w, end->signature, end->signature_size);
    return end_record(&w, chain);
}

static unsigned last_type(unsigned version) {
    return version >= 4 ? TRACE_REMARK : version == 3 ? TRACE_RESUME : TRACE_END;
}

enum result record_decode_prefix(const uint8_t *prefix, unsigned version, size_t *out_rest,
                                 struct error *err) {
    struct reader r = {prefix, RECORD_PREFIX, 0, false};
    uint32_t size = read_u32(&r);
    unsigned type = read_u8(&r);
    if (size > RECORD_PAYLOAD_MAX)
        return fail(err, RESULT_FORMAT, "a record claims %u bytes, more than %d", size,
                    RECORD_PAYLOAD_MAX);
    if (type < TRACE_STEP || type > last_type(version))
        return fail(err, RESULT_FORMAT, "a record has the unknown type %u", type);
    *out_rest = size + checksum_size(version);
    return RESULT_OK;
}

static bool read_block(struct reader *r, uint8_t *out, size_t *out_size, size_t size_max) {
    *out_size = read_u16(r);
    const uint8_t *bytes = *out_size <= size_max ? read_bytes(r, *out_size) : NULL;
    if (bytes)
        memcpy(out, bytes, *out_size);
    return bytes;
}

static bool read_end(struct reader *r, unsigned version, struct trace_end *out) {
    memset(out, 0, sizeof *out);
    out->records = read_u64(r);
    out->missing = read_u64(r);
    return version < 3 ||
           (read_block(r, out->certificate, &out->certificate_size, sizeof out->certificate) &&
            read_block(r, out->signature, &out->signature_size, sizeof out->signature));
}

static bool read_remark(struct reader *r, struct remark *out) {
    out->number = read_u32(r);
    out->time_ns = read_i64(r);
    read_text(r, out->author, sizeof out->author);
    read_text(r, out->text, sizeof out->text);
    unsigned withdrawn = read_u8(r), has_marker = read_u8(r);
    out->withdrawn = withdrawn;
    out->has_marker = has_marker;
    out->body = read_u8(r);
    out->point = read_vec3(r);
    return withdrawn <= 1 && has_marker <= 1 && time_is_sane(out->time_ns) && remark_is_valid(out);
}

static bool read_payload(struct reader *r, unsigned version, struct trace_record *out,
                         struct trace_end *out_end) {
    out->type = read_u8(r);
    switch (out->type) {
    case TRACE_STEP:
        return read_input(r, &out->input, &out->job_done) &&
               read_output(r, version, &out->output) && out->output.time_ns == out->input.time_ns;
    case TRACE_PAST:
        return read_input(r, &out->input, &out->job_done);
    case TRACE_GAP:
        out->missing = read_u64(r);
        return out->missing > 0;
    case TRACE_RESUME:
        out->utc_ns = read_i64(r);
        return true;
    case TRACE_REMARK:
        return read_remark(r, &out->remark);
    default:
        return read_end(r, version, out_end);
    }
}

enum result record_decode(const uint8_t *data, size_t size, unsigned version, struct chain *chain,
                          struct trace_record *out, struct trace_end *out_end, struct error *err) {
    if (!checksum_matches(data, size, version, chain))
        return fail(err, RESULT_CORRUPT, "the checksum of a record is wrong");
    memset(out, 0, sizeof *out);
    struct reader r = {data, size - checksum_size(version), 4, false};
    if (!read_payload(&r, version, out, out_end) || r.underflow || r.used != r.size)
        return fail(err, RESULT_FORMAT, "a field of a record is out of range");
    if (out->type == TRACE_END) {
        out->records = out_end->records;
        out->missing = out_end->missing;
    }
    return RESULT_OK;
}
