#include "step/fields.h"

#include "base/check.h"
#include "step/field_types.h"

#include <stdio.h>
#include <string.h>
#include <xxhash.h>

// A field that is added, a channel or a body needs a row here, a line in trace/FORMAT.md and a new
// TRACE_VERSION.
_Static_assert(CHANNEL_COUNT == 12 && INSTRUMENT_COUNT == 8 && BODY_COUNT == 3, "channels, bodies");
_Static_assert(sizeof(struct instrument_output) == 592, "the output of an instrument");
_Static_assert(sizeof(struct blade_move) == 136, "a move");
_Static_assert(sizeof(struct job) == 24 + JOB_MOVES_MAX * sizeof(struct blade_move), "a job");
_Static_assert(sizeof(struct tissue_figures) == 352, "the figures of a tissue");
_Static_assert(sizeof(struct session_output) == 6216 + sizeof(struct job), "the output of a step");
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "values are copied as they lie");
_Static_assert(offsetof(pose, translation) == 4 * sizeof(double), "a pose is seven reals");

#define FIRST_VERSION 2 // of traces
#define RULES_WITH_MOVES 2
#define RULES_WITH_FITTED_TOUCH 3

// ---- the table ----------------------------------------------------------------------------------

// Some values of one type that lie one behind the other.
struct member {
    const char *name;         // "" where the parts say all
    const char *const *parts; // of each value; NULL: it is one
    const struct field_type *type;
    size_t offset;
    int count, since;
};

#define ONE(name, type, struct, member)                                                            \
    { name, NULL, &field_##type, offsetof(struct, member), 1, FIRST_VERSION }
#define ONE_SINCE(version, name, type, struct, member)                                             \
    { name, NULL, &field_##type, offsetof(struct, member), 1, version }
#define REALS(name, parts, struct, member)                                                         \
    {                                                                                              \
        name, parts, &field_real, offsetof(struct, member), sizeof parts / sizeof *parts,          \
            FIRST_VERSION                                                                          \
    }

static const char *const pose_parts[] = {"qw", "qx", "qy", "qz", "tx_mm", "ty_mm", "tz_mm"};
static const char *const motion_parts[] = {"vx", "vy", "vz", "s_mm"};
static const char *const length_parts[] = {"x_mm", "y_mm", "z_mm"};
static const char *const matrix_parts[] = {"xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"};
static const char *const joint_parts[] = {"flexion_deg", "varus_deg", "internal_deg",
                                          "shift_mm",    "drawer_mm", "distraction_mm"};
static const char *const slope_parts[] = {
    "vx_by_x", "vx_by_y", "vx_by_z", "vx_by_turn_x", "vx_by_turn_y", "vx_by_turn_z",
    "vy_by_x", "vy_by_y", "vy_by_z", "vy_by_turn_x", "vy_by_turn_y", "vy_by_turn_z",
    "vz_by_x", "vz_by_y", "vz_by_z", "vz_by_turn_x", "vz_by_turn_y", "vz_by_turn_z",
    "s_by_x",  "s_by_y",  "s_by_z",  "s_by_turn_x",  "s_by_turn_y",  "s_by_turn_z"};
static const char *const zone_parts[] = {
    "anterior_inner_mm3",  "anterior_middle_mm3",  "anterior_outer_mm3",
    "body_inner_mm3",      "body_middle_mm3",      "body_outer_mm3",
    "posterior_inner_mm3", "posterior_middle_mm3", "posterior_outer_mm3"};
_Static_assert(ZONE_ANTERIOR_HORN == 0 && ZONE_BODY == 1 && ZONE_POSTERIOR_HORN == 2 &&
                   ZONE_INNER == 0 && ZONE_MIDDLE == 1 && ZONE_OUTER == 2,
               "the order of zones");

static const struct member step_members[] = {
    ONE("step", count, struct session_output, step),
    ONE("frame_number", count, struct session_output, frame_number),
    ONE("time_ns", time, struct session_output, time_ns),
    ONE("state", state, struct session_output, state),
    ONE("events", events, struct session_output, events),
    REALS("", joint_parts, struct session_output, joint),
    ONE("joint_validity", validity, struct session_output, joint_validity),
};

static const struct member pose_member[] = {{"", pose_parts, &field_real, 0, 7, FIRST_VERSION}};
static const struct member real_member[] = {{"", NULL, &field_real, 0, 1, 3}};
static const struct member later_pose_member[] = {{"", pose_parts, &field_real, 0, 7, 3}};

static const struct member torn_member[] = {
    ONE_SINCE(3, "torn_count", torn_count, struct session_output, torn_count)};

static const struct member present_member[] = {
    ONE("valid", flag, struct instrument_output, present)};

static const struct member instrument_members[] = {
    ONE("validity", validity, struct instrument_output, validity),
    REALS("", pose_parts, struct instrument_output, T_mockup_tip),
    REALS("warped", pose_parts, struct instrument_output, T_mockup_warped),
    REALS("displacement", length_parts, struct instrument_output, warp.displacement),
    REALS("gradient", matrix_parts, struct instrument_output, warp.gradient),
    ONE("trust_radius_mm", real, struct instrument_output, warp.trust_radius_mm),
    ONE("nearest", nearest, struct instrument_output, warp.nearest),
    ONE("nearest_mm", real, struct instrument_output, warp.nearest_mm),
};

static const struct member mode_member[] = {
    ONE_SINCE(3, "mode", mode, struct avatar_extrapolation, mode)};

static const struct member lead_members[] = {
    {"portal", length_parts, &field_real, offsetof(struct avatar_extrapolation, portal), 3, 3},
    {"", motion_parts, &field_real, offsetof(struct avatar_extrapolation, motion), 4, 3},
    {"", slope_parts, &field_real, offsetof(struct avatar_extrapolation, slope), 24, 3},
    ONE_SINCE(3, "reach_mm", real, struct avatar_extrapolation, reach_mm),
    ONE_SINCE(3, "trust_radius_mm", real, struct avatar_extrapolation, trust_radius_mm),
};

static const struct member discrepancy_members[] = {
    ONE_SINCE(3, "penetration_mm", real, struct instrument_output, penetration_mm),
    ONE_SINCE(3, "tip_gap_mm", real, struct instrument_output, tip_gap_mm),
    ONE_SINCE(3, "offset_mm", real, struct instrument_output, discrepancy.offset_mm),
    ONE_SINCE(3, "tilt_deg", real, struct instrument_output, discrepancy.tilt_deg),
    ONE_SINCE(3, "gain", real, struct instrument_output, discrepancy.gain),
    ONE_SINCE(3, "gain_least", real, struct instrument_output, discrepancy.gain_least),
    ONE_SINCE(3, "turn_deg", real, struct instrument_output, discrepancy.turn_deg),
};

static const struct member handle_members[] = {
    ONE("opening", real, struct instrument_output, handle.opening),
    ONE("buttons", bits, struct instrument_output, handle.buttons),
    ONE("handle_validity", validity, struct instrument_output, handle_validity),
};

static const struct member job_id_member[] = {ONE("job", count, struct job, id)};

static const struct member job_members[] = {
    ONE("job_kind", job, struct job, kind),
    ONE("job_tissue", tissue, struct job, tissue),
};

static const struct member cut_members[] = {
    ONE_SINCE(4, "job_stroke", bits, struct job, stroke),
    ONE("job_blade", blade, struct job, moves[0].blade),
};

static const struct member move_count_member[] = {
    ONE_SINCE(5, "job_moves", move_count, struct job, move_count)};

static const struct member move_members[] = {
    REALS("from", pose_parts, struct blade_move, T_mesh_tip[0]),
    ONE("opening_from", real, struct blade_move, opening[0]),
    REALS("to", pose_parts, struct blade_move, T_mesh_tip[1]),
    ONE("opening_to", real, struct blade_move, opening[1]),
};

static const struct member landed_id_member[] = {ONE("landed_job", count, struct landed, job)};

static const struct member landed_members[] = {
    ONE("landed_outcome", outcome, struct landed, outcome),
    ONE("landed_tissue", tissue, struct landed, tissue),
    ONE("mesh_number", bits, struct landed, figures.mesh_number),
    ONE("cuts", bits, struct landed, figures.cuts),
    ONE("cuts_refused", bits, struct landed, figures.refused),
    ONE("pieces", bits, struct landed, figures.pieces),
    ONE("volume_mm3", real, struct landed, figures.volume_mm3),
    ONE("removed_mm3", real, struct landed, figures.removed_mm3),
    ONE("pieces_mm3", real, struct landed, figures.pieces_mm3),
    ONE("warped_mm3", real, struct landed, figures.warped_mm3),
    ONE("left_mm3", real, struct landed, figures.left_mm3),
    ONE("distance_mm", real, struct landed, figures.distance_mm),
    ONE("quality_removed_mm3", real, struct landed, figures.quality.removed_mm3),
    ONE("quality_planned_mm3", real, struct landed, figures.quality.planned_mm3),
    ONE("quality_over_mm3", real, struct landed, figures.quality.over_mm3),
    ONE("quality_under_mm3", real, struct landed, figures.quality.under_mm3),
    ONE("quality_damage_mm3", real, struct landed, figures.quality.damage_mm3),
    ONE("quality_rim_mm", real, struct landed, figures.quality.rim_mm),
    ONE("quality_step_mm", real, struct landed, figures.quality.step_mm),
    REALS("whole", zone_parts, struct landed, figures.quality.whole),
    REALS("removed", zone_parts, struct landed, figures.quality.removed),
    REALS("budget", zone_parts, struct landed, figures.quality.budget),
    ONE("landed_hash", hash, struct landed, hash),
};

static const struct member fitted_members[] = {
    ONE_SINCE(5, "touched_unseen_mm3", real, struct landed, figures.touched_unseen_mm3),
    ONE_SINCE(5, "seen_untouched_mm3", real, struct landed, figures.seen_untouched_mm3),
    ONE_SINCE(5, "touch_hash", hash, struct landed, touch_hash),
};

static const struct member loose_members[] = {
    ONE_SINCE(6, "state", loose, struct loose_output, state),
    ONE_SINCE(6, "on", carrier, struct loose_output, carrier),
    {"", pose_parts, &field_real, offsetof(struct loose_output, T_mockup_loose), 7, 6},
};
_Static_assert(sizeof(struct loose_output) == 64, "a loose body");

// Of all fields: that of older versions is of fewer.
static const struct member hash_member[] = {
    ONE_SINCE(4, "hash", hash, struct session_output, hash)};

// ---- going through it ---------------------------------------------------------------------------

// One way through an output, for whatever is done with its fields.
struct pass {
    enum { ENCODE, DECODE, LIST } task;
    struct writer *w;
    struct reader *r;
    int version, rules;
    bool good;
    const struct session_output *output;
    struct step_field *fields;
    int field_count, owner;
    const char *prefix, *prefix2; // of names; NULL: none
};

static void encode(struct writer *w, const struct member *m, const char *at) {
    if (m->type->size == m->type->encoded)
        write_bytes(w, at, (size_t)m->count * m->type->size);
    else
        write_bytes(w, at, 1); // the low byte of an enum or a count
}

static int64_t whole_number(const struct field_type *type, const char *at) {
    int32_t value = 0;
    memcpy(&value, at, type->size);
    return value;
}

static bool decode(struct pass *p, const struct member *m, char *at) {
    if (m->since > p->version)
        return true;
    size_t size = (size_t)m->count * m->type->encoded;
    const uint8_t *bytes = read_bytes(p->r, size);
    if (!bytes)
        return false;
    bool checked = m->type->least != m->type->most;
    if (checked && m->type->encoded == 1 && m->type->size == 1 && *bytes > 1) // a bool has two
        return false;
    memcpy(at, bytes, size);
    int64_t value = checked ? whole_number(m->type, at) : 0;
    return !checked || (value >= m->type->least && value <= m->type->most);
}

static void list(struct pass *p, const struct member *m, const char *at) {
    for (int i = 0; i < m->count; i++) {
        CHECK(p->field_count < STEP_FIELDS_MAX);
        struct step_field *field = &p->fields[p->field_count++];
        const char *words[] = {p->prefix, p->prefix2, m->name, m->parts ? m->parts[i] : ""};
        size_t used = 0;
        for (size_t k = 0; k < sizeof words / sizeof *words; k++)
            if (words[k] && *words[k])
                used += (size_t)snprintf(field->name + used, sizeof field->name - used, "%s%s",
                                         used ? "_" : "", words[k]);
        CHECK(used < sizeof field->name);
        field->owner = p->owner;
        field->since = m->since;
        field->presence = m == present_member;
        field->offset = (size_t)(at - (const char *)p->output) + (size_t)i * m->type->size;
        field->type = m->type;
    }
}

static void take(struct pass *p, const struct member *members, size_t count, void *base) {
    for (size_t i = 0; i < count; i++) {
        char *at = (char *)base + members[i].offset;
        if (p->task == ENCODE)
            encode(p->w, &members[i], at);
        else if (p->task == DECODE)
            p->good = p->good && decode(p, &members[i], at);
        else
            list(p, &members[i], at);
    }
}

#define TAKE(pass, members, base) take(pass, members, sizeof members / sizeof *members, base)

static void name(struct pass *p, int owner, const char *prefix, const char *prefix2) {
    p->owner = owner;
    p->prefix = prefix;
    p->prefix2 = prefix2;
}

// A virtual bone is told where it is elsewhere than the mock-up's.
static void take_bone(struct pass *p, struct session_output *o, int i) {
    pose *physical = &o->T_mockup_body[i], *virtual = &o->T_mockup_virtual[i];
    uint8_t elsewhere = memcmp(physical, virtual, sizeof *physical) != 0;
    name(p, OWNER_STEP, body_name((enum body)i), NULL);
    TAKE(p, pose_member, physical);
    if (p->task == ENCODE)
        write_u8(p->w, elsewhere);
    if (p->task == DECODE) {
        *virtual = *physical;
        elsewhere = p->version >= 3 ? read_u8(p->r) : 0;
        p->good = p->good && elsewhere <= 1;
    }
    name(p, OWNER_STEP, "virtual", body_name((enum body)i));
    if (elsewhere || p->task == LIST)
        TAKE(p, later_pose_member, virtual);
}

static void take_torn(struct pass *p, struct session_output *o) {
    static const char *const names[] = {"torn_1", "torn_2", "torn_3", "torn_4",
                                        "torn_5", "torn_6", "torn_7", "torn_8"};
    _Static_assert(sizeof names / sizeof *names == ADAPTIVE_LIGAMENTS_MAX, "a name for each");
    name(p, OWNER_STEP, NULL, NULL);
    TAKE(p, torn_member, o);
    int count = p->task == LIST ? ADAPTIVE_LIGAMENTS_MAX : p->good ? o->torn_count : 0;
    for (int i = 0; i < count; i++) {
        name(p, OWNER_STEP, names[i], "opening");
        TAKE(p, real_member, &o->opening[i]);
        name(p, OWNER_STEP, names[i], "share");
        TAKE(p, real_member, &o->share[i]);
    }
}

// That of `tip` is the space warp's.
static void lead_of_tip(const struct warp *warp, struct avatar_extrapolation *out) {
    out->mode = AVATAR_TIP;
    out->motion.v = warp->displacement;
    for (int i = 0; i < 3; i++)
        memcpy(out->slope[i], warp->gradient.m[i], sizeof warp->gradient.m[i]);
    out->trust_radius_mm = warp->trust_radius_mm;
}

static void take_lead(struct pass *p, struct instrument_output *o, const char *tool) {
    name(p, p->owner, tool, "lead");
    TAKE(p, mode_member, &o->extrapolation);
    if (o->extrapolation.mode != AVATAR_TIP || p->task == LIST)
        TAKE(p, lead_members, &o->extrapolation);
    else if (p->task == DECODE)
        lead_of_tip(&o->warp, &o->extrapolation);
    name(p, p->owner, tool, NULL);
}

static void take_instrument(struct pass *p, struct instrument_output *o, int instrument) {
    const char *tool = channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument));
    name(p, instrument, tool, NULL);
    TAKE(p, present_member, o);
    if (!o->present && p->task != LIST)
        return;
    TAKE(p, instrument_members, o);
    if (p->task == DECODE && p->version < 3)
        read_f64(p->r); // another gain
    take_lead(p, o, tool);
    TAKE(p, discrepancy_members, o);
    TAKE(p, handle_members, o);
}

static void take_moves(struct pass *p, struct job *job) {
    static const char *const names[] = {"job",    "job_2",  "job_3",  "job_4",  "job_5",  "job_6",
                                        "job_7",  "job_8",  "job_9",  "job_10", "job_11", "job_12",
                                        "job_13", "job_14", "job_15", "job_16"};
    _Static_assert(sizeof names / sizeof *names == JOB_MOVES_MAX, "a name for each");
    int count = p->task == LIST ? JOB_MOVES_MAX : p->good ? job->move_count : 0;
    for (int i = 0; i < count; i++) {
        name(p, OWNER_MOVE - i, names[i], NULL);
        if (p->task == DECODE)
            job->moves[i].blade = job->moves[0].blade;
        TAKE(p, move_members, &job->moves[i]);
    }
}

static void take_job(struct pass *p, struct job *job) {
    name(p, OWNER_JOB, NULL, NULL);
    TAKE(p, job_id_member, job);
    if (!job->id && p->task != LIST)
        return;
    TAKE(p, job_members, job);
    if (job->kind != JOB_CUT && p->task != LIST)
        return;
    name(p, OWNER_CUT, NULL, NULL);
    TAKE(p, cut_members, job);
    if (p->task == DECODE)
        job->move_count = 1;
    if (p->rules >= RULES_WITH_MOVES)
        TAKE(p, move_count_member, job);
    take_moves(p, job);
}

static void take_landed(struct pass *p, struct landed *landed) {
    name(p, OWNER_LANDED, NULL, NULL);
    TAKE(p, landed_id_member, landed);
    if (landed->job || p->task == LIST)
        TAKE(p, landed_members, landed);
    if ((landed->job && p->rules >= RULES_WITH_FITTED_TOUCH) || p->task == LIST)
        TAKE(p, fitted_members, landed);
}

static void take_loose(struct pass *p, struct session_output *o) {
    static const char *const names[] = {"loose_1", "loose_2", "loose_3", "loose_4",
                                        "loose_5", "loose_6", "loose_7", "loose_8"};
    _Static_assert(sizeof names / sizeof *names == CASE_LOOSE_MAX, "a name for each");
    int count = p->task == LIST ? CASE_LOOSE_MAX : o->loose_count;
    for (int i = 0; i < count; i++) {
        name(p, OWNER_LOOSE - i, names[i], NULL);
        TAKE(p, loose_members, &o->loose[i]);
    }
}

static void take_job_and_landed(struct pass *p, struct session_output *o) {
    take_job(p, &o->job);
    take_landed(p, &o->landed);
}

static void take_output(struct pass *p, struct session_output *o) {
    name(p, OWNER_STEP, NULL, NULL);
    TAKE(p, step_members, o);
    for (int i = 0; i < BODY_COUNT; i++)
        take_bone(p, o, i);
    take_torn(p, o);
    int instruments = p->task == LIST ? INSTRUMENT_COUNT : INSTRUMENTS_USUAL + o->described;
    for (int i = 0; i < instruments; i++)
        take_instrument(p, &o->instruments[i], i);
    take_job_and_landed(p, o);
    take_loose(p, o);
}

// Only DECODE writes to the output.
static struct session_output *unchanged(const struct session_output *output) {
    return (struct session_output *)output;
}

void output_encode(struct writer *w, const struct session_output *output, int rules) {
    struct pass p = {.task = ENCODE, .w = w, .rules = rules, .good = true};
    take_output(&p, unchanged(output));
}

bool output_decode(struct reader *r, int version, int rules, int described, int loose,
                   struct session_output *out) {
    struct pass p = {.task = DECODE, .r = r, .version = version, .rules = rules, .good = true};
    out->described = described;
    out->loose_count = loose;
    take_output(&p, out);
    return p.good;
}

void output_encode_job(struct writer *w, const struct session_output *output, int rules) {
    struct pass p = {.task = ENCODE, .w = w, .rules = rules, .good = true};
    take_job_and_landed(&p, unchanged(output));
}

bool output_decode_job(struct reader *r, int version, int rules, struct session_output *out) {
    struct pass p = {.task = DECODE, .r = r, .version = version, .rules = rules, .good = true};
    take_job_and_landed(&p, out);
    return p.good;
}

uint64_t output_hash(uint64_t previous, const struct session_output *output, int rules) {
    uint8_t data[10240];
    struct writer w = {data, sizeof data, 0, false};
    write_u64(&w, previous);
    output_encode(&w, output, rules);
    CHECK(!w.overflow);
    return XXH3_64bits(data, w.used);
}

int step_fields(struct step_field out_fields[STEP_FIELDS_MAX]) {
    static const struct session_output none;
    struct pass p = {.task = LIST, .output = &none, .fields = out_fields};
    take_output(&p, unchanged(&none));
    name(&p, OWNER_STEP, NULL, NULL);
    TAKE(&p, hash_member, unchanged(&none));
    return p.field_count;
}

// ---- one field ----------------------------------------------------------------------------------

static const char *field_at(const struct step_field *field, const void *output) {
    return (const char *)output + field->offset;
}

int step_field_part(const struct step_field *field) {
    if (field->owner <= OWNER_LOOSE)
        return OWNER_STEP;
    return field->owner == OWNER_CUT || field->owner <= OWNER_MOVE ? OWNER_JOB : field->owner;
}

bool step_field_is_there(const struct step_field *field, const struct session_output *output) {
    const struct job *job = &output->job;
    if (field->owner == OWNER_STEP)
        return true;
    if (field->owner <= OWNER_LOOSE)
        return OWNER_LOOSE - field->owner < output->loose_count;
    if (field->owner == OWNER_JOB)
        return job->id != 0;
    if (field->owner == OWNER_LANDED)
        return output->landed.job != 0;
    if (field->owner == OWNER_CUT)
        return job->id && job->kind == JOB_CUT;
    if (field->owner <= OWNER_MOVE)
        return job->id && job->kind == JOB_CUT && OWNER_MOVE - field->owner < job->move_count;
    return field->presence || output->instruments[field->owner].present;
}

bool step_field_equal(const struct step_field *field, const struct session_output *a,
                      const struct session_output *b) {
    return memcmp(field_at(field, a), field_at(field, b), field->type->size) == 0;
}

void step_field_text(const struct step_field *field, const void *output,
                     char out_text[FIELD_TEXT_MAX]) {
    field->type->print(field_at(field, output), out_text);
}

double step_field_number(const struct step_field *field, const void *output) {
    return field->type->number(field_at(field, output));
}

size_t step_field_size(const struct step_field *field) {
    return field->type->size;
}

uint64_t step_field_bits(const struct step_field *field, const void *output) {
    uint64_t bits = 0;
    memcpy(&bits, field_at(field, output), field->type->size);
    return bits;
}
