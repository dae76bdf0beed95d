#include "unit/trace_files.h"

#include "base/check.h"
#include "random.h"
#include "step/fields.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define LOOSE 2

char path[FOLDER_MAX + 16], copy_path[FOLDER_MAX + 16];
static char folder[FOLDER_MAX];

int make_folder(void **state) {
    (void)state;
    folder_make(folder);
    snprintf(path, sizeof path, "%s/a.trace", folder);
    snprintf(copy_path, sizeof copy_path, "%s/b.trace", folder);
    return 0;
}

int remove_folder(void **state) {
    (void)state;
    unlink(path);
    unlink(copy_path);
    return rmdir(folder);
}

// ---- random steps

static double any_real(struct random *r) {
    static const double odd[] = {0, -0.0, INFINITY, -INFINITY, NAN, 0x1p-1074, 1e308};
    uint64_t bits = random_bits(r);
    if (bits % 16 < sizeof odd / sizeof *odd)
        return odd[bits % 16];
    return random_between(r, -1e3, 1e3);
}

static vec3 any_vec3(struct random *r) {
    double x = any_real(r), y = any_real(r);
    return (vec3){x, y, any_real(r)};
}

static pose any_pose(struct random *r) {
    vec3 v = any_vec3(r);
    return (pose){{any_real(r), v.x, v.y, v.z}, any_vec3(r)};
}

static struct sample random_sample(struct random *r, int64_t time_ns) {
    struct sample s = {.validity = random_bits(r) % VALIDITY_COUNT,
                       .device = (uint8_t)random_bits(r),
                       .time_ns = time_ns};
    s.channel = random_bits(r) % CHANNEL_COUNT;
    if (s.channel == CHANNEL_JOINT) {
        s.kind = SAMPLE_JOINT;
        s.joint = (struct joint_angles){random_between(r, -20, 150), random_between(r, -9, 9),
                                        random_between(r, -9, 9),    random_between(r, -9, 9),
                                        random_between(r, -9, 9),    -0.0};
    } else if (s.channel >= CHANNEL_FIRST_INSTRUMENT && random_bits(r) % 2) {
        s.kind = SAMPLE_HANDLE;
        s.handle = (struct handle){random_between(r, 0, 1), (uint32_t)random_bits(r)};
    } else if (random_bits(r) % 4 == 0) {
        s.kind = SAMPLE_FORCE;
        s.force_n = random_between(r, -FORCE_MAX_N, FORCE_MAX_N);
    } else {
        s.kind = SAMPLE_POSE;
        s.T_mockup_body = random_pose(r, 300);
    }
    return s;
}

static void random_input(struct random *r, int64_t time_ns, struct session_input *out) {
    memset(out, 0, sizeof *out);
    out->kind = random_bits(r) % 3 ? INPUT_FRAME : random_bits(r) % INPUT_KIND_COUNT;
    out->time_ns = time_ns;
    if (out->kind == INPUT_JOB)
        out->job = random_bits(r);
    if (out->kind != INPUT_FRAME)
        return;
    out->frame.number = random_bits(r);
    out->frame.time_ns = time_ns - 1000;
    out->frame.count = (int)(random_bits(r) % (FRAME_SAMPLES_MAX + 1));
    for (int i = 0; i < out->frame.count; i++)
        out->frame.samples[i] = random_sample(r, time_ns - 2000);
}

// That of `tip` says what the space warp says.
static void random_lead(struct random *r, const struct warp *warp,
                        struct avatar_extrapolation *out) {
    out->mode = random_bits(r) % AVATAR_MODE_COUNT;
    bool tip = out->mode == AVATAR_TIP;
    out->motion.v = tip ? warp->displacement : any_vec3(r);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < (tip ? 3 : 6); k++)
            out->slope[i][k] = tip ? warp->gradient.m[i][k] : any_real(r);
    out->trust_radius_mm = tip ? warp->trust_radius_mm : any_real(r);
    if (tip)
        return;
    for (int k = 0; k < 6; k++)
        out->slope[3][k] = any_real(r);
    out->portal = any_vec3(r);
    out->motion.s = any_real(r);
    out->reach_mm = any_real(r);
}

static void random_bones(struct random *r, struct session_output *out) {
    for (int i = 0; i < BODY_COUNT; i++) {
        out->T_mockup_body[i] = any_pose(r);
        out->T_mockup_virtual[i] = random_bits(r) % 2 ? any_pose(r) : out->T_mockup_body[i];
    }
    out->torn_count = (int)(random_bits(r) % (ADAPTIVE_LIGAMENTS_MAX + 1));
    for (int i = 0; i < out->torn_count; i++) {
        out->opening[i] = any_real(r);
        out->share[i] = any_real(r);
    }
}

static void random_loose(struct random *r, struct session_output *out) {
    out->loose_count = LOOSE;
    for (int i = 0; i < LOOSE; i++) {
        out->loose[i].state = random_bits(r) % LOOSE_STATE_COUNT;
        out->loose[i].carrier = (int)(random_bits(r) % (BODY_COUNT + INSTRUMENT_COUNT));
        out->loose[i].T_mockup_loose = any_pose(r);
    }
}

static void random_instrument(struct random *r, struct instrument_output *out) {
    out->present = random_bits(r) % 2;
    if (!out->present)
        return;
    out->validity = random_bits(r) % VALIDITY_COUNT;
    out->T_mockup_tip = any_pose(r);
    out->T_mockup_warped = any_pose(r);
    out->warp.displacement = any_vec3(r);
    for (int i = 0; i < 9; i++)
        out->warp.gradient.m[i / 3][i % 3] = any_real(r);
    out->warp.trust_radius_mm = any_real(r);
    out->warp.nearest = (int)(random_bits(r) % (WARP_SURFACES_MAX + 1)) - 1;
    out->warp.nearest_mm = any_real(r);
    random_lead(r, &out->warp, &out->extrapolation);
    double *meters[] = {&out->penetration_mm,        &out->tip_gap_mm,
                        &out->discrepancy.offset_mm, &out->discrepancy.tilt_deg,
                        &out->discrepancy.gain,      &out->discrepancy.gain_least,
                        &out->discrepancy.turn_deg};
    for (size_t i = 0; i < sizeof meters / sizeof *meters; i++)
        *meters[i] = any_real(r);
    out->handle = (struct handle){any_real(r), (uint32_t)random_bits(r)};
    out->handle_validity = random_bits(r) % VALIDITY_COUNT;
}

static void random_job(struct random *r, struct job *out) {
    if (random_bits(r) % 2)
        return;
    out->id = 1 + random_bits(r) % 100;
    out->kind = JOB_CUT + (enum job_kind)(random_bits(r) % (JOB_KIND_COUNT - JOB_CUT));
    out->tissue = (int)(random_bits(r) % TISSUES_MAX);
    if (out->kind != JOB_CUT)
        return;
    out->stroke = (uint32_t)random_bits(r);
    int blade = random_bits(r) % (BLADE_KNIFE + 1);
    out->move_count = 1 + (int)(random_bits(r) % JOB_MOVES_MAX);
    for (int i = 0; i < out->move_count; i++) {
        out->moves[i].blade = blade;
        for (int k = 0; k < 2; k++) {
            out->moves[i].T_mesh_tip[k] = any_pose(r);
            out->moves[i].opening[k] = any_real(r);
        }
    }
}

static void random_landed(struct random *r, struct landed *out) {
    if (random_bits(r) % 2)
        return;
    out->job = 1 + random_bits(r) % 100;
    out->outcome = random_bits(r) % JOB_OUTCOME_COUNT;
    out->tissue = (int)(random_bits(r) % TISSUES_MAX);
    out->hash = random_bits(r);
    struct tissue_figures *f = &out->figures;
    uint32_t *counts[] = {&f->mesh_number, &f->cuts, &f->refused, &f->pieces};
    for (int i = 0; i < 4; i++)
        *counts[i] = (uint32_t)random_bits(r);
    double *first = &f->volume_mm3; // from here on all are doubles
    for (size_t i = 0; i < (sizeof *f - offsetof(struct tissue_figures, volume_mm3)) / 8; i++)
        first[i] = any_real(r);
}

static void random_output(struct random *r, uint64_t step, int64_t time_ns,
                          struct session_output *out) {
    memset(out, 0, sizeof *out);
    out->step = step;
    out->frame_number = random_bits(r);
    out->time_ns = time_ns;
    out->state = random_bits(r) % SESSION_STATE_COUNT;
    out->events = (uint32_t)random_bits(r);
    vec3 angles = any_vec3(r), shifts = any_vec3(r);
    out->joint = (struct joint_angles){angles.x, angles.y, angles.z, shifts.x, shifts.y, shifts.z};
    out->joint_validity = random_bits(r) % VALIDITY_COUNT;
    random_bones(r, out);
    out->described = 1;
    for (int i = 0; i < INSTRUMENTS_USUAL + out->described; i++)
        random_instrument(r, &out->instruments[i]);
    random_job(r, &out->job);
    random_landed(r, &out->landed);
    random_loose(r, out);
    out->hash = random_bits(r);
}

// Step n of the random session: the same for the same n.
void step_at(uint64_t n, struct session_input *input, struct session_output *output) {
    struct random r = {n * 7919};
    int64_t time_ns = 5000000000 + (int64_t)n * 1000000;
    random_input(&r, time_ns, input);
    random_output(&r, n, time_ns, output);
}

struct trace_header some_header(void) {
    struct trace_header h = {
        .session_id = "0123456789abcde",
        .parent = {1, 2, 3},
        .parent_id = "edcba9876543210", // another one: it was copied
        .station = "bench 3",
        .trainee = "Zoë",
        .case_name = "healthy",
        .case_dir = "/srv/cases/healthy",
        .case_hash = 0x1122334455667788,
        .start_utc_ns = 1790000000000000000,
        .start_ns = 5000000000,
        .settings = {.rules = RULES_NEWEST,
                     .field = {FIELD_INTEGRAL, 10, 12, 0.05, 0.02, 0.75},
                     .adaptive = ADAPTIVE_PAPER,
                     .avatar = AVATAR_RIGID,
                     .hold_ns = 100000000,
                     .ease_share = 0.25,
                     .ease_mm_s = 1.5},
        .optic = {70, 85.5},
        .loose_count = LOOSE,
        .part = 1,
        .server = "north",
        .token = 0x8877665544332211,
    };
    struct session_settings usual = session_settings_default();
    h.settings.instruments = usual.instruments;
    memcpy(h.settings.bodies, usual.bodies, sizeof usual.bodies);
    for (int i = 0; i <= INSTRUMENTS_USUAL; i++)
        h.settings.bodies[i] = (struct instrument_body){2, {{{0, 0, 0}, 0}, {{1, -3, i}, 0.5}}};
    struct instrument curette = instrument_of_kind(INSTRUMENT_BLADE);
    strcpy(curette.name, "curette");
    curette.length_mm = 5;
    curette.colour = 0xffcc00;
    enum result result = instruments_add(&h.settings.instruments, &curette, NULL);
    CHECK(result == RESULT_OK);
    trace_header_set_machine(&h);
    return h;
}

struct trace_writer *start_writing(void) {
    unlink(path);
    struct trace_header header = some_header();
    struct trace_writer *writer;
    struct error err = {""};
    if (trace_writer_create(path, &header, NULL, NULL, &writer, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return writer;
}

bool append_step(struct trace_writer *writer, uint64_t n) {
    struct session_input input;
    struct session_output output;
    step_at(n, &input, &output);
    return trace_append(writer, &input, &output);
}

void write_trace(uint64_t steps) {
    struct trace_writer *writer = start_writing();
    for (uint64_t n = 1; n <= steps; n++)
        assert_true(append_step(writer, n));
    trace_writer_destroy(&writer);
    assert_null(writer);
}

struct trace_reader *open_trace(const char *from) {
    struct trace_reader *reader;
    struct error err = {""};
    if (trace_reader_create(from, &reader, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return reader;
}

static void assert_same_sample(const struct sample *a, const struct sample *b) {
    assert_int_equal(a->channel, b->channel);
    assert_int_equal(a->kind, b->kind);
    assert_int_equal(a->validity, b->validity);
    assert_int_equal(a->device, b->device);
    assert_true(a->time_ns == b->time_ns);
    if (a->kind == SAMPLE_JOINT)
        assert_memory_equal(&a->joint, &b->joint, sizeof a->joint);
    if (a->kind == SAMPLE_POSE)
        assert_memory_equal(&a->T_mockup_body, &b->T_mockup_body, sizeof a->T_mockup_body);
    if (a->kind == SAMPLE_FORCE)
        assert_true(a->force_n == b->force_n);
    if (a->kind == SAMPLE_HANDLE) {
        assert_true(a->handle.opening == b->handle.opening);
        assert_int_equal(a->handle.buttons, b->handle.buttons);
    }
}

static void assert_same_input(const struct session_input *a, const struct session_input *b) {
    assert_int_equal(a->kind, b->kind);
    assert_true(a->time_ns == b->time_ns);
    assert_true(a->frame.number == b->frame.number);
    assert_true(a->frame.time_ns == b->frame.time_ns);
    assert_int_equal(a->frame.count, b->frame.count);
    for (int i = 0; i < a->frame.count; i++)
        assert_same_sample(&a->frame.samples[i], &b->frame.samples[i]);
}

static void assert_same_output(const struct session_output *a, const struct session_output *b) {
    static struct step_field fields[STEP_FIELDS_MAX];
    static int count;
    if (!count)
        count = step_fields(fields);
    for (int i = 0; i < count; i++)
        if (!step_field_equal(&fields[i], a, b))
            fail_msg("%s differs in step %d", fields[i].name, (int)a->step);
}

void assert_is_step(const struct trace_record *record, uint64_t n) {
    struct session_input input;
    struct session_output output;
    step_at(n, &input, &output);
    assert_int_equal(record->type, TRACE_STEP);
    assert_same_input(&record->input, &input);
    assert_same_output(&record->output, &output);
}

// Reads a file that may be damaged: whatever is accepted must be what was written.
struct outcome read_prefix_of_steps(const char *from) {
    struct outcome o = {0};
    struct trace_reader *reader;
    struct trace_record record;
    o.end = trace_reader_create(from, &reader, &o.err);
    if (o.end != RESULT_OK)
        return o;
    struct trace_header header = some_header();
    header.version = TRACE_VERSION;
    assert_memory_equal(trace_reader_header(reader), &header, sizeof header);
    while ((o.end = trace_read(reader, &record, &o.err)) == RESULT_OK)
        if (record.type == TRACE_STEP)
            assert_is_step(&record, ++o.steps);
    trace_reader_destroy(&reader);
    return o;
}
