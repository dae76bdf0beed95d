#include "export/describe.h"

#include "base/clock.h"

#include <inttypes.h>
#include <stdio.h>
#include <time.h>

#define TEXT_MAX 512

// "0 waiting, 1 running, ..."
static void list_names(struct image_writer *writer, const char *attribute,
                       const char *(*name)(int value), int count) {
    char text[TEXT_MAX];
    size_t used = 0;
    for (int i = 0; i < count && used < sizeof text; i++)
        used +=
            (size_t)snprintf(text + used, sizeof text - used, "%s%d %s", i ? ", " : "", i, name(i));
    image_writer_text(writer, 0, attribute, text);
}

static const char *state_text(int value) {
    return session_state_name((enum session_state)value);
}

static const char *validity_text(int value) {
    return validity_name((enum validity)value);
}

static const char *input_text(int value) {
    return input_kind_name((enum input_kind)value);
}

static const char *job_text(int value) {
    return job_kind_name((enum job_kind)value);
}

static const char *outcome_text(int value) {
    return job_outcome_name((enum job_outcome)value);
}

static const char *blade_text(int value) {
    return channel_name((enum channel)(value + CHANNEL_PUNCH));
}

static const char *mode_text(int value) {
    return avatar_mode_name((enum avatar_mode)value);
}

static void describe_names(struct image_writer *writer) {
    list_names(writer, "arthron:names_state", state_text, SESSION_STATE_COUNT);
    list_names(writer, "arthron:names_event_bits", event_name, EVENT_COUNT);
    list_names(writer, "arthron:names_validity", validity_text, VALIDITY_COUNT);
    list_names(writer, "arthron:names_input", input_text, INPUT_KIND_COUNT);
    list_names(writer, "arthron:names_job_kind", job_text, JOB_KIND_COUNT);
    list_names(writer, "arthron:names_landed_outcome", outcome_text, JOB_OUTCOME_COUNT);
    list_names(writer, "arthron:names_job_blade", blade_text, BLADE_MOST + 1);
    list_names(writer, "arthron:names_lead_mode", mode_text, AVATAR_MODE_COUNT);
    image_writer_text(writer, 0, "arthron:units",
                      "lengths mm, angles deg (names end so), t_seconds s since the session's "
                      "start, names ending in _ns nanoseconds, volumes mm3");
    image_writer_text(writer, 0, "arthron:frames",
                      "poses take coordinates of the body or of the instrument's tip to those of "
                      "the mock-up's frame (right-handed, x to the patient's right, y anterior, z "
                      "proximal): p = q v q* + t with the unit quaternion qw + qx i + qy j + qz k; "
                      "NAME is measured, NAME_warped and virtual_NAME are shown; maps are in the "
                      "frame of their group");
}

static void describe_session(const struct trace_header *h, struct image_writer *writer) {
    char text[TEXT_MAX];
    bytes_text(h->session_id, sizeof h->session_id, text);
    image_writer_text(writer, 0, "arthron:session", text);
    image_writer_text(writer, 0, "arthron:station", h->station);
    image_writer_text(writer, 0, "arthron:case", h->case_name);
    snprintf(text, sizeof text, "%016" PRIx64, h->case_hash);
    image_writer_text(writer, 0, "arthron:case_hash", text);
    time_t seconds = (time_t)(h->start_utc_ns / NS_PER_S);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    image_writer_text(writer, 0, "arthron:start", text);
    snprintf(text, sizeof text, "%" PRId64, h->start_ns);
    image_writer_text(writer, 0, "arthron:start_time_ns", text);
    image_writer_number(writer, 0, "arthron:optic_tilt_deg", h->optic.tilt_deg);
    image_writer_number(writer, 0, "arthron:optic_field_deg", h->optic.field_deg);
    image_writer_text(writer, 0, "arthron:build", h->build);
    image_writer_text(writer, 0, "arthron:libc", h->libc);
    image_writer_text(writer, 0, "arthron:cpu", h->cpu);
}

static void describe_settings(const struct session_settings *s, struct image_writer *writer) {
    image_writer_text(writer, 0, "arthron:field", field_name(s->field.kind));
    image_writer_number(writer, 0, "arthron:field_unit_mm", s->field.unit_mm);
    image_writer_number(writer, 0, "arthron:field_radius_mm", s->field.radius_mm);
    image_writer_number(writer, 0, "arthron:field_background_per_mm", s->field.background_per_mm);
    image_writer_number(writer, 0, "arthron:field_skin_mm", s->field.skin_mm);
    image_writer_number(writer, 0, "arthron:field_strength", s->field.strength);
    image_writer_text(writer, 0, "arthron:adaptive", adaptive_name(s->adaptive));
    image_writer_text(writer, 0, "arthron:avatar", avatar_mode_name(s->avatar));
    image_writer_number(writer, 0, "arthron:hold_s", (double)s->hold_ns / (double)NS_PER_S);
    image_writer_number(writer, 0, "arthron:ease_share", s->ease_share);
    image_writer_number(writer, 0, "arthron:ease_mm_s", s->ease_mm_s);
}

void exr_describe(const struct contents *contents, struct image_writer *writer) {
    char hash[2 * TRACE_HASH_SIZE + 1];
    image_writer_text(writer, 0, "arthron:program", "arthron-trace " ARTHRON_VERSION);
    describe_session(&contents->header, writer);
    bytes_text(contents->hash, sizeof contents->hash, hash);
    image_writer_text(writer, 0, "arthron:trace_hash", hash);
    describe_settings(&contents->header.settings, writer);
    describe_names(writer);
    image_writer_number(writer, 0, "arthron:whole", contents->end == RESULT_CLOSED);
}
