#include "trace/fields.h"

#include "base/check.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

struct trace_type {
    size_t size;
    void (*print)(const void *value, char *out); // into TRACE_FIELD_TEXT_MAX
};

#define DEFINE_TYPE(name, c_type, format, shown)                                                   \
    static void print_##name(const void *value, char *out) {                                       \
        c_type v;                                                                                  \
        memcpy(&v, value, sizeof v);                                                               \
        snprintf(out, TRACE_FIELD_TEXT_MAX, format, shown);                                        \
    }                                                                                              \
    static const struct trace_type name##_type = {sizeof(c_type), print_##name}

DEFINE_TYPE(real, double, "%.17g", v);
DEFINE_TYPE(count, uint64_t, "%" PRIu64, v);
DEFINE_TYPE(time, int64_t, "%" PRId64, v);
DEFINE_TYPE(index, int, "%d", v);
DEFINE_TYPE(bits, uint32_t, "%" PRIu32, v);
DEFINE_TYPE(hash, uint64_t, "%016" PRIx64, v);
DEFINE_TYPE(flag, bool, "%d", v);
DEFINE_TYPE(state, enum session_state, "%s", session_state_name(v));
DEFINE_TYPE(validity, enum validity, "%s", validity_name(v));

static void print_events(const void *value, char *out) {
    static const char *const names[] = {"state", "device_lost", "device_back", "contact",
                                        "release"};
    uint32_t events;
    memcpy(&events, value, sizeof events);
    size_t used = 0;
    out[0] = '\0';
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (events >> i & 1)
            used += (size_t)snprintf(out + used, TRACE_FIELD_TEXT_MAX - used, "%s%s",
                                     used ? "+" : "", names[i]);
}

static const struct trace_type events_type = {sizeof(uint32_t), print_events};

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
    {"gain", &real_type, TOOL(gain)},
};

static const struct member valid_member[] = {{"valid", &flag_type, TOOL(present)}};

#define COUNT(array) (sizeof(array) / sizeof *(array))

struct list {
    struct trace_field *fields;
    int count;
};

// Members of what stands at `base` in the output, named after `owner` where that is not empty.
static void add_members(struct list *list, const struct member *members, size_t count, size_t base,
                        const char *owner, int instrument) {
    for (size_t i = 0; i < count; i++) {
        CHECK(list->count < TRACE_FIELDS_MAX);
        struct trace_field *field = &list->fields[list->count++];
        snprintf(field->name, sizeof field->name, "%s%s%s", owner, *owner ? "_" : "",
                 members[i].name);
        field->instrument = instrument;
        field->presence = members == valid_member;
        field->offset = base + members[i].offset;
        field->type = members[i].type;
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
}

int trace_fields(struct trace_field out_fields[TRACE_FIELDS_MAX]) {
    struct list list = {out_fields, 0};
    add_members(&list, first_members, COUNT(first_members), 0, "", -1);
    for (int i = 0; i < BODY_COUNT; i++)
        add_members(&list, pose_members, COUNT(pose_members),
                    OUTPUT(T_mockup_body) + (size_t)i * sizeof(pose), body_name((enum body)i), -1);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        add_tool(&list, i);
    add_members(&list, last_members, COUNT(last_members), 0, "", -1);
    return list.count;
}

static const char *field_at(const struct trace_field *field, const struct session_output *output) {
    return (const char *)output + field->offset;
}

bool trace_field_equal(const struct trace_field *field, const struct session_output *a,
                       const struct session_output *b) {
    return memcmp(field_at(field, a), field_at(field, b), field->type->size) == 0;
}

void trace_field_text(const struct trace_field *field, const struct session_output *output,
                      char out_text[TRACE_FIELD_TEXT_MAX]) {
    field->type->print(field_at(field, output), out_text);
}
