#include "trace/record.h"

#include "base/bytes.h"
#include "base/check.h"
#include "session/digest.h"

#include <string.h>
#include <xxhash.h>

// Version 3 has these, and these only: whoever adds a field, a channel or a body writes it here, in
// fields.c and in FORMAT.md, and raises TRACE_VERSION.
_Static_assert(CHANNEL_COUNT == 9 && INSTRUMENT_COUNT == 5 && BODY_COUNT == 3, "channels, bodies");
_Static_assert(FRAME_SAMPLES_MAX == 16 && sizeof(struct sample) == 80, "the sample");
_Static_assert(sizeof(struct instrument_output) == 592, "the output of an instrument");
_Static_assert(sizeof(struct job) == 152, "a job");
_Static_assert(sizeof(struct tissue_figures) == 336, "the figures of a tissue");
_Static_assert(sizeof(struct session_output) == 4040, "the output of a step");
_Static_assert(sizeof(struct session_settings) == 2680, "the settings");

enum {
    POSE_SIZE = 7 * 8,
    SAMPLE_SIZE_MAX = 4 + 8 + POSE_SIZE,
    INPUT_SIZE_MAX = 1 + 8 + 8 + 8 + 1 + FRAME_SAMPLES_MAX * SAMPLE_SIZE_MAX,
    LEAD_SIZE_MAX = 1 + 2 * 3 * 8 + 8 + 24 * 8 + 2 * 8,
    INSTRUMENT_SIZE_MAX =
        2 + 2 * POSE_SIZE + 3 * 8 + 9 * 8 + 8 + 4 + 8 + LEAD_SIZE_MAX + 7 * 8 + 8 + 4 + 1,
    BONES_SIZE_MAX = BODY_COUNT * (2 * POSE_SIZE + 1) + 1 + ADAPTIVE_LIGAMENTS_MAX * 2 * 8,
    JOB_SIZE_MAX = 8 + 3 + 2 * (POSE_SIZE + 8),
    LANDED_SIZE_MAX = 8 + 2 + sizeof(struct tissue_figures) + 8,
    OUTPUT_SIZE_MAX = 3 * 8 + 1 + 4 + 6 * 8 + 1 + BONES_SIZE_MAX +
                      INSTRUMENT_COUNT * INSTRUMENT_SIZE_MAX + JOB_SIZE_MAX + LANDED_SIZE_MAX + 8
};
_Static_assert(INPUT_SIZE_MAX + OUTPUT_SIZE_MAX <= RECORD_PAYLOAD_MAX, "a step fits");
_Static_assert(sizeof(struct trace_header) < HEADER_FIELDS_MAX, "a header fits");

// Times are added and subtracted: this keeps them from overflowing for 73 years of either sign.
#define TIME_MAX_NS (INT64_MAX / 4)

static bool time_is_sane(int64_t time_ns) {
    return time_ns >= -TIME_MAX_NS && time_ns <= TIME_MAX_NS;
}

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

// ---- the header

static void write_body(struct writer *w, const struct instrument_body *body) {
    write_u8(w, (uint8_t)body->point_count);
    for (int i = 0; i < body->point_count; i++) {
        write_vec3(w, body->points[i].at);
        write_f64(w, body->points[i].radius_mm);
    }
}

// Of too many points none is read: body_is_valid refuses them.
static void read_body(struct reader *r, struct instrument_body *out) {
    out->point_count = read_u8(r);
    for (int i = 0; out->point_count <= AVATAR_POINTS_MAX && i < out->point_count; i++) {
        out->points[i].at = read_vec3(r);
        out->points[i].radius_mm = read_f64(r);
    }
}

static void write_settings(struct writer *w, const struct session_settings *s) {
    write_u8(w, (uint8_t)s->field.kind);
    write_f64(w, s->field.unit_mm);
    write_f64(w, s->field.radius_mm);
    write_f64(w, s->field.background_per_mm);
    write_f64(w, s->field.skin_mm);
    write_f64(w, s->field.strength);
    write_u8(w, (uint8_t)s->adaptive);
    write_u8(w, (uint8_t)s->avatar);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        write_body(w, &s->bodies[i]);
    write_i64(w, s->hold_ns);
    write_f64(w, s->ease_share);
    write_f64(w, s->ease_mm_s);
}

static void read_settings(struct reader *r, struct session_settings *out) {
    out->field.kind = read_u8(r);
    out->field.unit_mm = read_f64(r);
    out->field.radius_mm = read_f64(r);
    out->field.background_per_mm = read_f64(r);
    out->field.skin_mm = read_f64(r);
    out->field.strength = read_f64(r);
    out->adaptive = read_u8(r);
    out->avatar = read_u8(r);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        read_body(r, &out->bodies[i]);
    out->hold_ns = read_i64(r);
    out->ease_share = read_f64(r);
    out->ease_mm_s = read_f64(r);
}

static bool settings_are_valid(const struct session_settings *s) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (!instrument_body_is_valid(&s->bodies[i]))
            return false;
    return (unsigned)s->adaptive < ADAPTIVE_COUNT && (unsigned)s->avatar < AVATAR_MODE_COUNT &&
           (unsigned)s->field.kind < FIELD_COUNT && s->field.unit_mm > 0 &&
           isfinite(s->field.unit_mm) && s->field.radius_mm > 0 && isfinite(s->field.radius_mm) &&
           s->field.background_per_mm >= 0 && isfinite(s->field.background_per_mm) &&
           s->field.skin_mm >= 0 && isfinite(s->field.skin_mm) && s->field.strength >= 0 &&
           s->field.strength <= 1 && s->hold_ns >= 0 && s->hold_ns <= TIME_MAX_NS &&
           s->ease_share >= 0 && isfinite(s->ease_share) && s->ease_mm_s >= 0 &&
           isfinite(s->ease_mm_s);
}

size_t header_encode(const struct trace_header *h, uint8_t *out) {
    struct writer w = {out, HEADER_MAX, HEADER_PREFIX, false};
    write_bytes(&w, h->session_id, sizeof h->session_id);
    write_text(&w, h->station);
    write_text(&w, h->trainee);
    write_text(&w, h->case_name);
    write_text(&w, h->case_dir);
    write_u64(&w, h->case_hash);
    write_i64(&w, h->start_utc_ns);
    write_i64(&w, h->start_ns);
    write_settings(&w, &h->settings);
    write_text(&w, h->build);
    write_text(&w, h->libc);
    write_text(&w, h->cpu);
    struct writer prefix = {out, HEADER_PREFIX, 0, false};
    write_bytes(&prefix, HEADER_MAGIC, 8);
    write_u16(&prefix, TRACE_VERSION);
    write_u32(&prefix, (uint32_t)(w.used - HEADER_PREFIX));
    write_u64(&w, XXH3_64bits(out, w.used));
    CHECK(!w.overflow && !prefix.overflow);
    return w.used;
}

enum result header_decode_prefix(const uint8_t *prefix, size_t *out_rest, struct error *err) {
    struct reader r = {prefix, HEADER_PREFIX, 0, false};
    if (memcmp(read_bytes(&r, 8), HEADER_MAGIC, 8) != 0)
        return fail(err, RESULT_FORMAT, "it does not begin as a trace does");
    unsigned version = read_u16(&r);
    if (version != TRACE_VERSION)
        return fail(err, RESULT_VERSION, "it has version %u, and this program reads version %d",
                    version, TRACE_VERSION);
    uint32_t size = read_u32(&r);
    if (size > HEADER_FIELDS_MAX)
        return fail(err, RESULT_LIMIT, "its header claims %u bytes, more than %d", size,
                    HEADER_FIELDS_MAX);
    *out_rest = size + RECORD_CHECKSUM;
    return RESULT_OK;
}

static bool checksum_matches(const uint8_t *data, size_t size) {
    struct reader r = {data + size - RECORD_CHECKSUM, RECORD_CHECKSUM, 0, false};
    return read_u64(&r) == XXH3_64bits(data, size - RECORD_CHECKSUM);
}

enum result header_decode(const uint8_t *data, size_t size, struct trace_header *h,
                          struct error *err) {
    if (!checksum_matches(data, size))
        return fail(err, RESULT_CORRUPT, "the checksum of its header is wrong");
    memset(h, 0, sizeof *h);
    struct reader r = {data, size - RECORD_CHECKSUM, HEADER_PREFIX, false};
    h->version = TRACE_VERSION;
    const uint8_t *id = read_bytes(&r, sizeof h->session_id);
    if (id)
        memcpy(h->session_id, id, sizeof h->session_id);
    read_text(&r, h->station, sizeof h->station);
    read_text(&r, h->trainee, sizeof h->trainee);
    read_text(&r, h->case_name, sizeof h->case_name);
    read_text(&r, h->case_dir, sizeof h->case_dir);
    h->case_hash = read_u64(&r);
    h->start_utc_ns = read_i64(&r);
    h->start_ns = read_i64(&r);
    read_settings(&r, &h->settings);
    read_text(&r, h->build, sizeof h->build);
    read_text(&r, h->libc, sizeof h->libc);
    read_text(&r, h->cpu, sizeof h->cpu);
    if (r.underflow || r.used != r.size)
        return fail(err, RESULT_FORMAT, "its header has not the size of its fields");
    if (!settings_are_valid(&h->settings) || !time_is_sane(h->start_ns))
        return fail(err, RESULT_FORMAT, "a setting in its header is out of range");
    return RESULT_OK;
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

static void write_input(struct writer *w, const struct session_input *input) {
    write_u8(w, (uint8_t)input->kind);
    write_i64(w, input->time_ns);
    if (input->kind == INPUT_JOB) {
        write_u64(w, input->job);
        write_u8(w, input->result != NULL);
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
static bool read_lead(struct reader *r, const struct warp *warp, struct avatar_lead *out) {
    out->mode = read_u8(r);
    if (out->mode == AVATAR_TIP) {
        out->motion.v = warp->displacement;
        for (int i = 0; i < 3; i++)
            memcpy(out->slope[i], warp->gradient.m[i], sizeof warp->gradient.m[i]);
        out->trust_radius_mm = warp->trust_radius_mm;
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

static bool read_bones(struct reader *r, struct session_output *out) {
    bool good = true;
    for (int i = 0; i < BODY_COUNT; i++) {
        out->T_mockup_body[i] = out->T_mockup_virtual[i] = read_pose(r);
        unsigned elsewhere = read_u8(r);
        if (elsewhere)
            out->T_mockup_virtual[i] = read_pose(r);
        good = good && elsewhere <= 1;
    }
    out->torn_count = read_u8(r);
    if (out->torn_count > ADAPTIVE_LIGAMENTS_MAX)
        return false;
    for (int i = 0; i < out->torn_count; i++) {
        out->opening[i] = read_f64(r);
        out->share[i] = read_f64(r);
    }
    return good;
}

static bool read_instrument(struct reader *r, struct instrument_output *out) {
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
    bool good = read_lead(r, &out->warp, &out->lead);
    out->penetration_mm = read_f64(r);
    out->tip_gap_mm = read_f64(r);
    out->discrepancy.offset_mm = read_f64(r);
    out->discrepancy.tilt_deg = read_f64(r);
    out->discrepancy.gain = read_f64(r);
    out->discrepancy.gain_least = read_f64(r);
    out->discrepancy.turn_deg = read_f64(r);
    out->handle = read_handle(r);
    out->handle_validity = read_u8(r);
    return good && (unsigned)out->validity < VALIDITY_COUNT &&
           (unsigned)out->handle_validity < VALIDITY_COUNT && out->warp.nearest >= -1 &&
           out->warp.nearest < WARP_SURFACES_MAX;
}

static bool read_job(struct reader *r, struct job *out) {
    out->id = read_u64(r);
    if (!out->id)
        return true;
    out->kind = read_u8(r);
    out->tissue = read_u8(r);
    if (out->kind == JOB_CUT) {
        out->move.kind = read_u8(r);
        for (int i = 0; i < 2; i++) {
            out->move.T_mesh_tip[i] = read_pose(r);
            out->move.opening[i] = read_f64(r);
        }
    }
    return (out->kind == JOB_CUT || out->kind == JOB_RESTORE) && out->tissue < TISSUES_MAX &&
           (unsigned)out->move.kind < BLADE_COUNT;
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

static bool read_output(struct reader *r, struct session_output *out) {
    out->step = read_u64(r);
    out->frame_number = read_u64(r);
    out->time_ns = read_i64(r);
    out->state = read_u8(r);
    out->events = read_u32(r);
    out->joint = read_joint(r);
    out->joint_validity = read_u8(r);
    bool good = (unsigned)out->state < SESSION_STATE_COUNT &&
                (unsigned)out->joint_validity < VALIDITY_COUNT;
    good = read_bones(r, out) && good;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        good = read_instrument(r, &out->instruments[i]) && good;
    good = read_job(r, &out->job) && good;
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

static size_t end_record(struct writer *w) {
    struct writer prefix = {w->data, 4, 0, false};
    write_u32(&prefix, (uint32_t)(w->used - RECORD_PREFIX));
    write_u64(w, XXH3_64bits(w->data, w->used));
    CHECK(!w->overflow);
    return w->used;
}

size_t record_encode_step(const struct session_input *input, const struct session_output *output,
                          uint8_t *out) {
    struct writer w = begin_record(TRACE_STEP, out);
    write_input(&w, input);
    write_output(&w, output);
    return end_record(&w);
}

size_t record_encode_gap(uint64_t missing, uint8_t *out) {
    struct writer w = begin_record(TRACE_GAP, out);
    write_u64(&w, missing);
    return end_record(&w);
}

size_t record_encode_end(uint64_t records, uint64_t missing, uint8_t *out) {
    struct writer w = begin_record(TRACE_END, out);
    write_u64(&w, records);
    write_u64(&w, missing);
    return end_record(&w);
}

enum result record_decode_prefix(const uint8_t *prefix, size_t *out_rest, struct error *err) {
    struct reader r = {prefix, RECORD_PREFIX, 0, false};
    uint32_t size = read_u32(&r);
    unsigned type = read_u8(&r);
    if (size > RECORD_PAYLOAD_MAX)
        return fail(err, RESULT_FORMAT, "a record claims %u bytes, more than %d", size,
                    RECORD_PAYLOAD_MAX);
    if (type < TRACE_STEP || type > TRACE_END)
        return fail(err, RESULT_FORMAT, "a record has the unknown type %u", type);
    *out_rest = size + RECORD_CHECKSUM;
    return RESULT_OK;
}

enum result record_decode(const uint8_t *data, size_t size, struct trace_record *out,
                          struct error *err) {
    if (!checksum_matches(data, size))
        return fail(err, RESULT_CORRUPT, "the checksum of a record is wrong");
    memset(out, 0, sizeof *out);
    struct reader r = {data, size - RECORD_CHECKSUM, 4, false};
    bool good = true;
    out->type = read_u8(&r);
    switch (out->type) {
    case TRACE_STEP:
        good = read_input(&r, &out->input, &out->job_done) && read_output(&r, &out->output) &&
               out->output.time_ns == out->input.time_ns;
        break;
    case TRACE_GAP:
        out->missing = read_u64(&r);
        good = out->missing > 0;
        break;
    case TRACE_END:
        out->records = read_u64(&r);
        out->missing = read_u64(&r);
        break;
    }
    if (!good || r.underflow || r.used != r.size)
        return fail(err, RESULT_FORMAT, "a field of a record is out of range");
    return RESULT_OK;
}
