#include "trace/record.h"

#include "base/bytes.h"
#include "base/check.h"
#include "step/fields.h"
#include "trace/state.h"

#include <string.h>

_Static_assert(FRAME_SAMPLES_MAX == 22 && sizeof(struct sample) == 80, "the sample");

// An output is encoded without padding, but with a byte for each bone that is elsewhere.
enum {
    POSE_SIZE = 7 * 8,
    SAMPLE_SIZE_MAX = 4 + 8 + POSE_SIZE,
    INPUT_SIZE_MAX = 1 + 8 + 8 + 8 + 1 + FRAME_SAMPLES_MAX * SAMPLE_SIZE_MAX,
    OUTPUT_SIZE_MAX = sizeof(struct session_output) + BODY_COUNT
};
_Static_assert(INPUT_SIZE_MAX + OUTPUT_SIZE_MAX <= RECORD_PAYLOAD_MAX, "a step fits");
_Static_assert(TRACE_TASK_MAX + 128 <= RECORD_PAYLOAD_MAX, "an attempt fits");

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
    case SAMPLE_FORCE:
        write_f64(w, s->force_n);
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
    case SAMPLE_FORCE:
        out->force_n = read_f64(r);
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

// ---- records

static struct writer begin_record(enum trace_record_type type, uint8_t *out) {
    struct writer w = {out, RECORD_MAX, 4, false};
    write_u8(&w, (uint8_t)type);
    return w;
}

static size_t end_record(struct writer *w, struct chain *chain) {
    struct writer prefix = {w->data, 4, 0, false};
    write_u32(&prefix, (uint32_t)(w->used - RECORD_PREFIX));
    static const uint8_t none[TRACE_HASH_SIZE];
    if (chain)
        chain_add(chain, w->data, w->used);
    write_bytes(w, chain ? chain->value : none, sizeof none);
    CHECK(!w->overflow);
    return w->used;
}

size_t record_encode_step(const struct session_input *input, bool job_done,
                          const struct session_output *output, int rules, struct chain *chain,
                          uint8_t *out) {
    struct writer w = begin_record(TRACE_STEP, out);
    write_input(&w, input, job_done);
    output_encode(&w, output, rules);
    write_u64(&w, output->hash);
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

size_t record_encode_fault(int64_t utc_ns, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_FAULT, out);
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

size_t record_encode_marker(const struct marker *marker, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_MARKER, out);
    write_u64(&w, marker->run);
    write_u64(&w, marker->number);
    write_i64(&w, marker->time_ns);
    write_text(&w, marker->name);
    write_text(&w, marker->device);
    write_f64(&w, marker->value);
    return end_record(&w, chain);
}

size_t record_encode_begun(const struct trace_attempt *attempt, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_BEGUN, out);
    write_u32(&w, attempt->number);
    write_u8(&w, (uint8_t)attempt->purpose);
    write_u8(&w, (uint8_t)attempt->hand);
    write_text(&w, attempt->task);
    write_u32(&w, attempt->mark_version);
    write_f64(&w, attempt->pass_time_s);
    write_u32(&w, attempt->pass_errors);
    write_u32(&w, attempt->size);
    write_bytes(&w, attempt->text, attempt->size);
    return end_record(&w, chain);
}

size_t record_encode_ended(const struct trace_outcome *outcome, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_ENDED, out);
    write_u32(&w, outcome->number);
    write_u8(&w, (uint8_t)outcome->end);
    write_u8(&w, (uint8_t)outcome->verdict);
    write_u32(&w, outcome->goals_met);
    write_u32(&w, outcome->errors);
    write_u64(&w, outcome->first_step);
    write_u64(&w, outcome->last_step);
    write_i64(&w, outcome->time_ns);
    return end_record(&w, chain);
}

size_t record_encode_touch(const struct trace_touch_part *part, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_TOUCH, out);
    write_u64(&w, part->job);
    write_u8(&w, (uint8_t)part->tissue);
    write_u32(&w, part->whole);
    write_u32(&w, part->offset);
    write_bytes(&w, part->bytes, part->size);
    return end_record(&w, chain);
}

size_t record_encode_state(const struct trace_state_part *part, struct chain *chain, uint8_t *out) {
    struct writer w = begin_record(TRACE_STATE, out);
    write_u32(&w, part->whole);
    write_u32(&w, part->offset);
    write_bytes(&w, part->bytes, part->size);
    return end_record(&w, chain);
}

size_t record_encode_taken(const struct trace_record *record, int rules, struct chain *chain,
                           uint8_t *out) {
    struct writer w = begin_record(TRACE_TAKEN, out);
    write_i64(&w, record->input.time_ns);
    output_encode_job(&w, &record->output, rules);
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

struct trace_layout layout_of(const struct trace_header *h, unsigned version) {
    return (struct trace_layout){version, h->settings.rules,
                                 h->settings.instruments.count - INSTRUMENTS_USUAL, h->loose_count};
}

static unsigned last_type(unsigned version) {
    return version >= TRACE_FIRST_WITH_PARTS      ? TRACE_TAKEN
           : version >= TRACE_FIRST_WITH_ATTEMPTS ? TRACE_ENDED
           : version >= TRACE_FIRST_WITH_FAULTS   ? TRACE_MARKER
           : version >= 4                         ? TRACE_REMARK
           : version == 3                         ? TRACE_RESUME
                                                  : TRACE_END;
}

enum result record_decode_prefix(const uint8_t *prefix, unsigned version, size_t *out_rest,
                                 struct error *err) {
    struct reader r = {prefix, RECORD_PREFIX, 0, false};
    uint32_t size = read_u32(&r);
    unsigned type = read_u8(&r);
    *out_rest = 0;
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

static bool read_marker(struct reader *r, struct marker *out) {
    out->run = read_u64(r);
    out->number = read_u64(r);
    out->time_ns = read_i64(r);
    read_text(r, out->name, sizeof out->name);
    read_text(r, out->device, sizeof out->device);
    out->value = read_f64(r);
    return time_is_sane(out->time_ns) && marker_is_valid(out);
}

static bool read_begun(struct reader *r, struct trace_attempt *out) {
    out->number = read_u32(r);
    out->purpose = read_u8(r);
    out->hand = read_u8(r);
    read_text(r, out->task, sizeof out->task);
    out->mark_version = read_u32(r);
    out->pass_time_s = read_f64(r);
    out->pass_errors = read_u32(r);
    out->size = read_u32(r);
    out->text = (const char *)read_bytes(r, out->size);
    return out->text && trace_attempt_is_valid(out);
}

static bool read_ended(struct reader *r, struct trace_outcome *out) {
    out->number = read_u32(r);
    out->end = read_u8(r);
    out->verdict = read_u8(r);
    out->goals_met = read_u32(r);
    out->errors = read_u32(r);
    out->first_step = read_u64(r);
    out->last_step = read_u64(r);
    out->time_ns = read_i64(r);
    return trace_outcome_is_valid(out);
}

static bool read_step(struct reader *r, struct trace_layout layout, struct trace_record *out) {
    bool good = read_input(r, &out->input, &out->job_done) &&
                output_decode(r, (int)layout.version, layout.rules, layout.described, layout.loose,
                              &out->output);
    out->output.hash = read_u64(r);
    return good && out->output.time_ns == out->input.time_ns;
}

static bool read_touch(struct reader *r, struct trace_touch_part *out) {
    out->job = read_u64(r);
    out->tissue = read_u8(r);
    out->whole = read_u32(r);
    out->offset = read_u32(r);
    out->size = (uint32_t)(r->size - r->used);
    out->bytes = read_bytes(r, out->size);
    return out->job && out->tissue < TISSUES_MAX && out->size > 0 &&
           out->whole <= TOUCH_BYTES_MAX && out->offset < out->whole &&
           out->size <= out->whole - out->offset;
}

static bool read_state(struct reader *r, struct trace_state_part *out) {
    out->whole = read_u32(r);
    out->offset = read_u32(r);
    out->size = (uint32_t)(r->size - r->used);
    out->bytes = read_bytes(r, out->size);
    return out->bytes && out->size > 0 && out->whole <= TRACE_STATE_MAX &&
           out->offset < out->whole && out->size <= out->whole - out->offset;
}

// A landing of no job: a reset had made it void.
static bool read_taken(struct reader *r, struct trace_layout layout, struct trace_record *out) {
    const struct job *job = &out->output.job;
    const struct landed *landed = &out->output.landed;
    out->input.kind = INPUT_JOB;
    out->input.time_ns = out->output.time_ns = read_i64(r);
    out->job_done = true;
    bool good = output_decode_job(r, (int)layout.version, layout.rules, &out->output);
    out->input.job = job->id;
    return good && job->id && time_is_sane(out->input.time_ns) &&
           (!landed->job ||
            (landed->job == job->id && (job->kind == JOB_UNDO || landed->tissue == job->tissue)));
}

static bool read_payload(struct reader *r, struct trace_layout layout, struct trace_record *out,
                         struct trace_end *out_end) {
    out->type = read_u8(r);
    switch (out->type) {
    case TRACE_STEP:
        return read_step(r, layout, out);
    case TRACE_PAST:
        return read_input(r, &out->input, &out->job_done);
    case TRACE_GAP:
        out->missing = read_u64(r);
        return out->missing > 0;
    case TRACE_RESUME:
    case TRACE_FAULT:
        out->utc_ns = read_i64(r);
        return utc_is_sane(out->utc_ns);
    case TRACE_REMARK:
        return read_remark(r, &out->remark);
    case TRACE_MARKER:
        return read_marker(r, &out->marker);
    case TRACE_TOUCH:
        return read_touch(r, &out->touch_part);
    case TRACE_BEGUN:
        return read_begun(r, &out->begun);
    case TRACE_ENDED:
        return read_ended(r, &out->ended);
    case TRACE_STATE:
        return read_state(r, &out->state_part);
    case TRACE_TAKEN:
        return read_taken(r, layout, out);
    default:
        return read_end(r, layout.version, out_end);
    }
}

enum result record_decode_bare(const uint8_t *data, size_t size, struct trace_layout layout,
                               struct trace_record *out, struct trace_end *out_end,
                               struct error *err) {
    memset(out, 0, sizeof *out);
    struct reader r = {data, size, 4, false};
    if (!read_payload(&r, layout, out, out_end) || r.underflow || r.used != r.size)
        return fail(err, RESULT_FORMAT, "a field of a record is out of range");
    if (out->type == TRACE_END) {
        out->records = out_end->records;
        out->missing = out_end->missing;
    }
    return RESULT_OK;
}

enum result record_decode(const uint8_t *data, size_t size, struct trace_layout layout,
                          struct chain *chain, struct trace_record *out, struct trace_end *out_end,
                          struct error *err) {
    if (!checksum_matches(data, size, layout.version, chain))
        return fail(err, RESULT_CORRUPT, "the checksum of a record is wrong");
    return record_decode_bare(data, size - checksum_size(layout.version), layout, out, out_end,
                              err);
}
