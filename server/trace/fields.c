#include "trace/fields.h"

#include "base/check.h"
#include "trace/trace.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

struct trace_type {
    size_t size;
    double (*number)(const void *value);
    void (*print)(const void *value, char *out); // into TRACE_FIELD_TEXT_MAX
};

#define DEFINE_NUMBER(name, c_type)                                                                \
    static double number_##name(const void *value) {                                               \
        c_type v;                                                                                  \
        memcpy(&v, value, sizeof v);                                                               \
        return (double)v;                                                                          \
    }

#define DEFINE_TYPE(name, c_type, format, shown)                                                   \
    DEFINE_NUMBER(name, c_type)                                                                    \
    static void print_##name(const void *value, char *out) {                                       \
        c_type v;                                                                                  \
        memcpy(&v, value, sizeof v);                                                               \
        snprintf(out, TRACE_FIELD_TEXT_MAX, format, shown);                                        \
    }                                                                                              \
    static const struct trace_type name##_type = {sizeof(c_type), number_##name, print_##name}

DEFINE_TYPE(real, double, "%.17g", v);
DEFINE_TYPE(count, uint64_t, "%" PRIu64, v);
DEFINE_TYPE(time, int64_t, "%" PRId64, v);
DEFINE_TYPE(index, int, "%d", v);
DEFINE_TYPE(bits, uint32_t, "%" PRIu32, v);
DEFINE_TYPE(hash, uint64_t, "%016" PRIx64, v);
DEFINE_TYPE(flag, bool, "%d", v);
DEFINE_TYPE(state, enum session_state, "%s", session_state_name(v));
DEFINE_TYPE(validity, enum validity, "%s", validity_name(v));
DEFINE_TYPE(blade, enum blade_kind, "%s", blade_name(v));
DEFINE_TYPE(job, enum job_kind, "%s", job_kind_name(v));
DEFINE_TYPE(mode, enum avatar_mode, "%s", avatar_mode_name(v));
DEFINE_TYPE(outcome, enum job_outcome, "%s", job_outcome_name(v));

DEFINE_NUMBER(events, uint32_t)

static void print_events(const void *value, char *out) {
    uint32_t events;
    memcpy(&events, value, sizeof events);
    size_t used = 0;
    out[0] = '\0';
    for (int i = 0; i < EVENT_COUNT; i++)
        if (events >> i & 1)
            used += (size_t)snprintf(out + used, TRACE_FIELD_TEXT_MAX - used, "%s%s",
                                     used ? "+" : "", event_name(i));
}

static const struct trace_type events_type = {sizeof(uint32_t), number_events, print_events};

struct member {
    const char *name;
    const struct trace_type *type;
    size_t offset;
};

#define OUTPUT(member) offsetof(struct session_output, member)
#define TOOL(member) offsetof(struct instrument_output, member)

static const struct member first_members[] = {
    {"step", &count_type, OUTPUT(step)},
    {"frame_number", &count_type, OUTPUT(frame_number)},
    {"time_ns", &time_type, OUTPUT(time_ns)},
    {"state", &state_type, OUTPUT(state)},
    {"events", &events_type, OUTPUT(events)},
    {"flexion_deg", &real_type, OUTPUT(joint.flexion_deg)},
    {"varus_deg", &real_type, OUTPUT(joint.varus_deg)},
    {"internal_deg", &real_type, OUTPUT(joint.internal_deg)},
    {"shift_mm", &real_type, OUTPUT(joint.shift_mm)},
    {"drawer_mm", &real_type, OUTPUT(joint.drawer_mm)},
    {"distraction_mm", &real_type, OUTPUT(joint.distraction_mm)},
    {"joint_validity", &validity_type, OUTPUT(joint_validity)},
};

static const struct member torn_members[] = {
    {"opening", &real_type, OUTPUT(opening)},
    {"share", &real_type, OUTPUT(share)},
};

static const struct member last_members[] = {
    {"hash", &hash_type, OUTPUT(hash)},
};

static const struct member pose_members[] = {
    {"tx_mm", &real_type, offsetof(pose, translation.x)},
    {"ty_mm", &real_type, offsetof(pose, translation.y)},
    {"tz_mm", &real_type, offsetof(pose, translation.z)},
    {"qw", &real_type, offsetof(pose, rotation.w)},
    {"qx", &real_type, offsetof(pose, rotation.x)},
    {"qy", &real_type, offsetof(pose, rotation.y)},
    {"qz", &real_type, offsetof(pose, rotation.z)},
};

static const struct member tool_members[] = {
    {"validity", &validity_type, TOOL(validity)},
    {"opening", &real_type, TOOL(handle.opening)},
    {"buttons", &bits_type, TOOL(handle.buttons)},
    {"handle_validity", &validity_type, TOOL(handle_validity)},
    {"displacement_x_mm", &real_type, TOOL(warp.displacement.x)},
    {"displacement_y_mm", &real_type, TOOL(warp.displacement.y)},
    {"displacement_z_mm", &real_type, TOOL(warp.displacement.z)},
    {"gradient_xx", &real_type, TOOL(warp.gradient.m[0][0])},
    {"gradient_xy", &real_type, TOOL(warp.gradient.m[0][1])},
    {"gradient_xz", &real_type, TOOL(warp.gradient.m[0][2])},
    {"gradient_yx", &real_type, TOOL(warp.gradient.m[1][0])},
    {"gradient_yy", &real_type, TOOL(warp.gradient.m[1][1])},
    {"gradient_yz", &real_type, TOOL(warp.gradient.m[1][2])},
    {"gradient_zx", &real_type, TOOL(warp.gradient.m[2][0])},
    {"gradient_zy", &real_type, TOOL(warp.gradient.m[2][1])},
    {"gradient_zz", &real_type, TOOL(warp.gradient.m[2][2])},
    {"trust_radius_mm", &real_type, TOOL(warp.trust_radius_mm)},
    {"nearest", &index_type, TOOL(warp.nearest)},
    {"nearest_mm", &real_type, TOOL(warp.nearest_mm)},
};

static const struct member follow_members[] = {
    {"penetration_mm", &real_type, TOOL(penetration_mm)},
    {"tip_gap_mm", &real_type, TOOL(tip_gap_mm)},
    {"offset_mm", &real_type, TOOL(discrepancy.offset_mm)},
    {"tilt_deg", &real_type, TOOL(discrepancy.tilt_deg)},
    {"gain", &real_type, TOOL(discrepancy.gain)},
    {"gain_least", &real_type, TOOL(discrepancy.gain_least)},
    {"turn_deg", &real_type, TOOL(discrepancy.turn_deg)},
};

#define LEAD(member) TOOL(lead.member)
static const struct member lead_members[] = {
    {"mode", &mode_type, LEAD(mode)},
    {"portal_x_mm", &real_type, LEAD(portal.x)},
    {"portal_y_mm", &real_type, LEAD(portal.y)},
    {"portal_z_mm", &real_type, LEAD(portal.z)},
    {"vx", &real_type, LEAD(motion.v.x)},
    {"vy", &real_type, LEAD(motion.v.y)},
    {"vz", &real_type, LEAD(motion.v.z)},
    {"s_mm", &real_type, LEAD(motion.s)},
    {"reach_mm", &real_type, LEAD(reach_mm)},
    {"trust_radius_mm", &real_type, LEAD(trust_radius_mm)},
};

// Of one row of a lead's slopes.
static const struct member slope_members[] = {
    {"by_x", &real_type, 0 * sizeof(double)},      {"by_y", &real_type, 1 * sizeof(double)},
    {"by_z", &real_type, 2 * sizeof(double)},      {"by_turn_x", &real_type, 3 * sizeof(double)},
    {"by_turn_y", &real_type, 4 * sizeof(double)}, {"by_turn_z", &real_type, 5 * sizeof(double)},
};

static const struct member job_members[] = {
    {"job", &count_type, OUTPUT(job.id)},
    {"job_kind", &job_type, OUTPUT(job.kind)},
    {"job_tissue", &index_type, OUTPUT(job.tissue)},
    {"job_blade", &blade_type, OUTPUT(job.move.kind)},
    {"job_opening_from", &real_type, OUTPUT(job.move.opening[0])},
    {"job_opening_to", &real_type, OUTPUT(job.move.opening[1])},
};

#define FIGURE(member) OUTPUT(landed.figures.member)

static const struct member landed_members[] = {
    {"landed_job", &count_type, OUTPUT(landed.job)},
    {"landed_outcome", &outcome_type, OUTPUT(landed.outcome)},
    {"landed_tissue", &index_type, OUTPUT(landed.tissue)},
    {"landed_hash", &hash_type, OUTPUT(landed.hash)},
    {"mesh_number", &bits_type, FIGURE(mesh_number)},
    {"cuts", &bits_type, FIGURE(cuts)},
    {"cuts_refused", &bits_type, FIGURE(refused)},
    {"pieces", &bits_type, FIGURE(pieces)},
    {"volume_mm3", &real_type, FIGURE(volume_mm3)},
    {"removed_mm3", &real_type, FIGURE(removed_mm3)},
    {"pieces_mm3", &real_type, FIGURE(pieces_mm3)},
    {"warped_mm3", &real_type, FIGURE(warped_mm3)},
    {"left_mm3", &real_type, FIGURE(left_mm3)},
    {"distance_mm", &real_type, FIGURE(distance_mm)},
    {"quality_removed_mm3", &real_type, FIGURE(quality.removed_mm3)},
    {"quality_planned_mm3", &real_type, FIGURE(quality.planned_mm3)},
    {"quality_over_mm3", &real_type, FIGURE(quality.over_mm3)},
    {"quality_under_mm3", &real_type, FIGURE(quality.under_mm3)},
    {"quality_damage_mm3", &real_type, FIGURE(quality.damage_mm3)},
    {"quality_rim_mm", &real_type, FIGURE(quality.rim_mm)},
    {"quality_step_mm", &real_type, FIGURE(quality.step_mm)},
};

#define ZONE(along, across, name)                                                                  \
    { name "_mm3", &real_type, offsetof(struct zone_volumes, mm3[along][across]) }

static const struct member zone_members[] = {
    ZONE(ZONE_ANTERIOR_HORN, ZONE_INNER, "anterior_inner"),
    ZONE(ZONE_ANTERIOR_HORN, ZONE_MIDDLE, "anterior_middle"),
    ZONE(ZONE_ANTERIOR_HORN, ZONE_OUTER, "anterior_outer"),
    ZONE(ZONE_BODY, ZONE_INNER, "body_inner"),
    ZONE(ZONE_BODY, ZONE_MIDDLE, "body_middle"),
    ZONE(ZONE_BODY, ZONE_OUTER, "body_outer"),
    ZONE(ZONE_POSTERIOR_HORN, ZONE_INNER, "posterior_inner"),
    ZONE(ZONE_POSTERIOR_HORN, ZONE_MIDDLE, "posterior_middle"),
    ZONE(ZONE_POSTERIOR_HORN, ZONE_OUTER, "posterior_outer"),
};

static const struct member valid_member[] = {{"valid", &flag_type, TOOL(present)}};

#define COUNT(array) (sizeof(array) / sizeof *(array))

struct list {
    struct trace_field *fields;
    int count;
    int since; // of the next
};

// Members of what stands at `base` in the output, named after `prefix` where that is not empty.
static void add_members(struct list *list, const struct member *members, size_t count, size_t base,
                        const char *prefix, int owner) {
    for (size_t i = 0; i < count; i++) {
        CHECK(list->count < TRACE_FIELDS_MAX);
        struct trace_field *field = &list->fields[list->count++];
        snprintf(field->name, sizeof field->name, "%s%s%s", prefix, *prefix ? "_" : "",
                 members[i].name);
        field->owner = owner;
        field->since = list->since;
        field->presence = members == valid_member;
        field->offset = base + members[i].offset;
        field->type = members[i].type;
    }
}

static void add_lead(struct list *list, int instrument, size_t base, const char *tool) {
    static const char *const rows[] = {"vx", "vy", "vz", "s"};
    char name[32];
    snprintf(name, sizeof name, "%s_lead", tool);
    add_members(list, lead_members, COUNT(lead_members), base, name, instrument);
    for (size_t i = 0; i < COUNT(rows); i++) {
        snprintf(name, sizeof name, "%s_lead_%s", tool, rows[i]);
        add_members(list, slope_members, COUNT(slope_members),
                    base + LEAD(slope) + i * 6 * sizeof(double), name, instrument);
    }
}

static void add_tool(struct list *list, int instrument) {
    size_t base = OUTPUT(instruments) + (size_t)instrument * sizeof(struct instrument_output);
    const char *name = channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument));
    char warped[32];
    snprintf(warped, sizeof warped, "%s_warped", name);
    add_members(list, pose_members, COUNT(pose_members), base + TOOL(T_mockup_tip), name,
                instrument);
    add_members(list, valid_member, 1, base, name, instrument);
    add_members(list, pose_members, COUNT(pose_members), base + TOOL(T_mockup_warped), warped,
                instrument);
    add_members(list, tool_members, COUNT(tool_members), base, name, instrument);
    list->since = 3;
    add_members(list, follow_members, COUNT(follow_members), base, name, instrument);
    add_lead(list, instrument, base, name);
    list->since = TRACE_OLDEST_VERSION;
}

static void add_virtual(struct list *list) {
    for (int i = 0; i < BODY_COUNT; i++) {
        char name[24];
        snprintf(name, sizeof name, "virtual_%s", body_name((enum body)i));
        add_members(list, pose_members, COUNT(pose_members),
                    OUTPUT(T_mockup_virtual) + (size_t)i * sizeof(pose), name, OWNER_STEP);
    }
}

static const struct member torn_count_member[] = {{"torn_count", &index_type, OUTPUT(torn_count)}};

static void add_torn(struct list *list) {
    add_members(list, torn_count_member, 1, 0, "", OWNER_STEP);
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX; i++) {
        char name[16];
        snprintf(name, sizeof name, "torn_%d", i + 1);
        add_members(list, torn_members, COUNT(torn_members), (size_t)i * sizeof(double), name,
                    OWNER_STEP);
    }
}

static const struct member stroke_member[] = {{"job_stroke", &bits_type, OUTPUT(job.stroke)}};

static void add_job(struct list *list) {
    add_members(list, job_members, COUNT(job_members), 0, "", OWNER_JOB);
    list->since = 4;
    add_members(list, stroke_member, 1, 0, "", OWNER_JOB);
    list->since = TRACE_OLDEST_VERSION;
    add_members(list, pose_members, COUNT(pose_members), OUTPUT(job.move.T_mesh_tip[0]), "job_from",
                OWNER_JOB);
    add_members(list, pose_members, COUNT(pose_members), OUTPUT(job.move.T_mesh_tip[1]), "job_to",
                OWNER_JOB);
}

static void add_landed(struct list *list) {
    add_members(list, landed_members, COUNT(landed_members), 0, "", OWNER_LANDED);
    add_members(list, zone_members, COUNT(zone_members), FIGURE(quality.whole), "whole",
                OWNER_LANDED);
    add_members(list, zone_members, COUNT(zone_members), FIGURE(quality.removed), "removed",
                OWNER_LANDED);
    add_members(list, zone_members, COUNT(zone_members), FIGURE(quality.budget), "budget",
                OWNER_LANDED);
}

int trace_fields(struct trace_field out_fields[TRACE_FIELDS_MAX]) {
    struct list list = {out_fields, 0, TRACE_OLDEST_VERSION};
    add_members(&list, first_members, COUNT(first_members), 0, "", OWNER_STEP);
    for (int i = 0; i < BODY_COUNT; i++)
        add_members(&list, pose_members, COUNT(pose_members),
                    OUTPUT(T_mockup_body) + (size_t)i * sizeof(pose), body_name((enum body)i),
                    OWNER_STEP);
    list.since = 3;
    add_virtual(&list);
    add_torn(&list);
    list.since = TRACE_OLDEST_VERSION;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        add_tool(&list, i);
    add_job(&list);
    add_landed(&list);
    list.since = 4; // of all fields: that of older versions is of fewer
    add_members(&list, last_members, COUNT(last_members), 0, "", OWNER_STEP);
    return list.count;
}

static const char *field_at(const struct trace_field *field, const struct session_output *output) {
    return (const char *)output + field->offset;
}

bool trace_field_is_there(const struct trace_field *field, const struct session_output *output) {
    switch (field->owner) {
    case OWNER_STEP:
        return true;
    case OWNER_JOB:
        return output->job.id != 0;
    case OWNER_LANDED:
        return output->landed.job != 0;
    default:
        return field->presence || output->instruments[field->owner].present;
    }
}

bool trace_field_equal(const struct trace_field *field, const struct session_output *a,
                       const struct session_output *b) {
    return memcmp(field_at(field, a), field_at(field, b), field->type->size) == 0;
}

void trace_field_text(const struct trace_field *field, const struct session_output *output,
                      char out_text[TRACE_FIELD_TEXT_MAX]) {
    field->type->print(field_at(field, output), out_text);
}

double trace_field_number(const struct trace_field *field, const struct session_output *output) {
    return field->type->number(field_at(field, output));
}

size_t trace_field_size(const struct trace_field *field) {
    return field->type->size;
}

uint64_t trace_field_bits(const struct trace_field *field, const struct session_output *output) {
    uint64_t bits = 0;
    memcpy(&bits, field_at(field, output), field->type->size);
    return bits;
}
