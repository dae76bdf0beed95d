#include "export/inputs.h"

#include "base/check.h"
#include "step/field_types.h"

#include <stdio.h>
#include <string.h>

// Owners of fields: of all inputs, of frames, of finished jobs, or a sample's channel and kind.
enum { OF_ALL = -1, OF_FRAMES = -2, OF_JOBS = -3 };

void input_row_of(const struct trace_record *record, struct input_row *row) {
    const struct session_input *input = &record->input;
    memset(row, 0, sizeof *row);
    row->kind = input->kind;
    if (input->kind == INPUT_JOB) {
        row->job = input->job;
        row->job_done = record->job_done;
    }
    if (input->kind != INPUT_FRAME)
        return;
    row->time_ns = input->frame.time_ns;
    for (int i = 0; i < input->frame.count; i++) {
        const struct sample *s = &input->frame.samples[i];
        row->sampled[s->channel][s->kind] = true;
        row->samples[s->channel][s->kind] = *s;
        row->device[s->channel][s->kind] = s->device;
    }
}

struct input_fields {
    struct step_field *fields;
    int count, owner;
    const char *prefix;
};

static void add_field(struct input_fields *list, const char *name, const struct field_type *type,
                      size_t offset) {
    CHECK(list->count < INPUT_FIELDS_MAX);
    struct step_field *field = &list->fields[list->count++];
    *field = (struct step_field){.owner = list->owner, .offset = offset, .type = type};
    snprintf(field->name, sizeof field->name, "%s%s", list->prefix, name);
}

static void add_values(struct input_fields *list, enum sample_kind kind, size_t base) {
    static const char *const angles[] = {"flexion_deg", "varus_deg", "internal_deg",
                                         "shift_mm",    "drawer_mm", "distraction_mm"};
    static const char *const parts[] = {"qw", "qx", "qy", "qz", "tx_mm", "ty_mm", "tz_mm"};
    if (kind == SAMPLE_HANDLE) {
        add_field(list, "opening", &field_real, base + offsetof(struct sample, handle.opening));
        add_field(list, "buttons", &field_bits, base + offsetof(struct sample, handle.buttons));
    } else if (kind == SAMPLE_FORCE) {
        add_field(list, "n", &field_real, base + offsetof(struct sample, force_n));
    } else if (kind == SAMPLE_JOINT) {
        for (size_t i = 0; i < sizeof angles / sizeof *angles; i++)
            add_field(list, angles[i], &field_real,
                      base + offsetof(struct sample, joint) + i * sizeof(double));
    } else {
        for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
            add_field(list, parts[i], &field_real,
                      base + offsetof(struct sample, T_mockup_body) + i * sizeof(double));
    }
}

static void add_sample(struct input_fields *list, enum channel channel, enum sample_kind kind) {
    static const char *const kinds[SAMPLE_KIND_COUNT] = {"", "", "handle_", "force_"};
    char prefix[40];
    size_t place = (size_t)channel * SAMPLE_KIND_COUNT + kind;
    size_t base = offsetof(struct input_row, samples) + place * sizeof(struct sample);
    snprintf(prefix, sizeof prefix, "measured_%s_%s", channel_name(channel), kinds[kind]);
    list->owner = (int)place;
    list->prefix = prefix;
    add_field(list, "time_ns", &field_time, base + offsetof(struct sample, time_ns));
    add_field(list, "validity", &field_validity, base + offsetof(struct sample, validity));
    add_field(list, "device", &field_nearest,
              offsetof(struct input_row, device) + place * sizeof(int));
    add_values(list, kind, base);
    list->prefix = "";
}

int input_fields(const bool sampled[CHANNEL_COUNT][SAMPLE_KIND_COUNT],
                 struct step_field out_fields[INPUT_FIELDS_MAX]) {
    struct input_fields list = {out_fields, 0, OF_ALL, ""};
    add_field(&list, "input", &field_input, offsetof(struct input_row, kind));
    list.owner = OF_JOBS;
    add_field(&list, "input_job", &field_count, offsetof(struct input_row, job));
    add_field(&list, "input_job_done", &field_flag, offsetof(struct input_row, job_done));
    list.owner = OF_FRAMES;
    add_field(&list, "frame_time_ns", &field_time, offsetof(struct input_row, time_ns));
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int k = 0; k < SAMPLE_KIND_COUNT; k++)
            if (sampled[c][k])
                add_sample(&list, (enum channel)c, (enum sample_kind)k);
    return list.count;
}

bool input_field_is_there(const struct step_field *field, const struct input_row *row) {
    if (field->owner == OF_FRAMES)
        return row->kind == INPUT_FRAME;
    if (field->owner == OF_JOBS)
        return row->kind == INPUT_JOB;
    return field->owner == OF_ALL ||
           row->sampled[field->owner / SAMPLE_KIND_COUNT][field->owner % SAMPLE_KIND_COUNT];
}

bool input_field_is_time(const struct step_field *field) {
    size_t length = strlen(field->name);
    return field->owner < 0 || !strcmp(field->name + length - strlen("_time_ns"), "_time_ns");
}
