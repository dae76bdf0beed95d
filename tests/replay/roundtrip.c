#include "replay/roundtrip.h"

#include "base/check.h"
#include "step/fields.h"
#include "trace/rerun.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void expect(struct roundtrip *r, bool same) {
    r->values++;
    r->differences += !same;
}

// ---- steps --------------------------------------------------------------------------------------

static const char *part_of(const struct step_field *field) {
    switch (step_field_part(field)) {
    case OWNER_STEP:
        return "steps";
    case OWNER_JOB:
        return "jobs";
    case OWNER_LANDED:
        return "landed";
    default:
        return channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + field->owner));
    }
}

// A field and where its values are.
struct column {
    struct step_field field;
    bool has_part;
    size_t size;
    const uint32_t *value, *low, *high;
};

static void find_column(const struct exr_parts *parts, struct column *column) {
    const struct exr_part *part = exr_part(parts, part_of(&column->field));
    column->size = step_field_size(&column->field);
    column->has_part = part;
    if (!part)
        return;
    column->value = exr_values(part, column->field.name, "");
    column->low = exr_values(part, column->field.name, ".low");
    column->high = exr_values(part, column->field.name, ".high");
}

static bool same_value(const struct column *column, const struct session_output *output,
                       uint64_t pixel) {
    const struct step_field *field = &column->field;
    bool there = step_field_is_there(field, output);
    if (!column->has_part) // an instrument that never came
        return !there || field->presence;
    if (!column->value && field->owner <= OWNER_MOVE) // no job had so many moves
        return !there;
    if (!column->value || !column->low != (column->size < 4) || !column->high != (column->size < 8))
        return false;
    uint64_t bits = there ? step_field_bits(field, output) : 0;
    float expected = there ? (float)step_field_number(field, output) : NAN, value;
    memcpy(&value, &column->value[pixel], sizeof value);
    bool same = isnan(expected) ? isnan(value) : memcmp(&value, &expected, sizeof value) == 0;
    same &= !column->low || column->low[pixel] == (uint32_t)bits;
    return same && (!column->high || column->high[pixel] == (uint32_t)(bits >> 32));
}

static void compare_step(const struct column *columns, int count,
                         const struct session_output *output, struct roundtrip *r) {
    for (int i = 0; i < count; i++) {
        int owner = step_field_part(&columns[i].field);
        if ((owner == OWNER_JOB && !output->job.id) ||
            (owner == OWNER_LANDED && !output->landed.job))
            continue;
        uint64_t pixel = owner == OWNER_JOB      ? r->jobs
                         : owner == OWNER_LANDED ? r->landed
                                                 : r->steps;
        expect(r, same_value(&columns[i], output, pixel));
    }
    r->steps++;
    r->jobs += output->job.id != 0;
    r->landed += output->landed.job != 0;
}

void roundtrip_fields(const struct exr_parts *parts, const char *trace, struct roundtrip *r) {
    static struct step_field fields[STEP_FIELDS_MAX];
    static struct column columns[STEP_FIELDS_MAX];
    struct trace_reader *reader;
    struct trace_record record;
    int count = step_fields(fields);
    for (int i = 0; i < count; i++) {
        columns[i] = (struct column){.field = fields[i]};
        find_column(parts, &columns[i]);
    }
    CHECK(trace_reader_create(trace, &reader, NULL) == RESULT_OK);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        if (record.type == TRACE_STEP)
            compare_step(columns, count, &record.output, r);
    trace_reader_destroy(&reader);
}

// ---- maps ---------------------------------------------------------------------------------------

// After the last job that was asked for: blends, or offsets.
struct touches {
    int width[TISSUES_MAX];
    double *of[TISSUES_MAX];
};

static const struct case_group *group_of(const struct scene *scene, int tissue) {
    return &scene_case(scene)->groups[scene_tissue_group(scene, tissue)];
}

static void remember(const struct operation *operation, const struct scene *scene,
                     struct touches *touches) {
    for (int i = 0; i < scene_tissue_count(scene); i++) {
        size_t count = group_of(scene, i)->mesh.vertex_count;
        size_t width = (size_t)operation_touch_width(operation, i);
        if (!width)
            continue;
        touches->width[i] = (int)width;
        touches->of[i] = alloc_resize(touches->of[i], width * count, sizeof(double));
        for (uint32_t v = 0; v < count; v++)
            operation_touch(operation, i, v, touches->of[i] + width * v);
    }
}

static double component(const float *vectors, uint32_t vertex, size_t axis) {
    return vectors ? (double)vectors[3 * (size_t)vertex + axis] : 0;
}

static void compare_exact(const struct exr_part *part, const char *name, size_t texel, double value,
                          struct roundtrip *r) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    expect(r, exr_values(part, name, ".low")[texel] == (uint32_t)bits &&
                  exr_values(part, name, ".high")[texel] == (uint32_t)(bits >> 32));
}

// touch: a blend, or an offset.
static void compare_texel(const struct exr_part *part, const struct case_group *group, size_t texel,
                          uint32_t vertex, const double *touch, int width, struct roundtrip *r) {
    static const char *const axes[3] = {".x", ".y", ".z"};
    static const char *const offsets[3] = {"offset.x", "offset.y", "offset.z"};
    if (width == 1)
        compare_exact(part, "blend", texel, *touch, r);
    for (size_t axis = 0; axis < 3; axis++) {
        double offset = width == 1 ? *touch * component(group->maxcut, vertex, axis) : touch[axis];
        float expected = (float)(component(group->warp, vertex, axis) + offset);
        const uint32_t *values = exr_values(part, "displacement", axes[axis]);
        expect(r, memcmp(&values[texel], &expected, sizeof expected) == 0);
        if (width == 3)
            compare_exact(part, offsets[axis], texel, offset, r);
        r->largest_offset_mm = fmax(r->largest_offset_mm, fabs(offset));
    }
}

static void compare_map(const struct exr_parts *parts, const struct case_group *group, uint64_t job,
                        const double *touch, int width, struct roundtrip *r) {
    char name[128];
    snprintf(name, sizeof name, "%s.job_%llu", group->name, (unsigned long long)job);
    const struct exr_part *part = exr_part(parts, name), *surface = exr_part(parts, group->name);
    uint32_t corners = 0;
    r->maps++;
    expect(r, part && surface);
    if (!part || !surface)
        return;
    const uint32_t *vertices = exr_values(surface, "vertex", "");
    for (size_t i = 0; i < (size_t)part->width * part->height; i++) {
        if (vertices[i] == MESH_NONE)
            continue;
        compare_texel(part, group, i, vertices[i], touch + (size_t)width * vertices[i], width, r);
        corners++;
    }
    expect(r, corners == 3 * group->mesh.triangle_count);
}

void roundtrip_maps(const struct exr_parts *parts, const char *trace, const struct scene *scene,
                    struct roundtrip *r) {
    struct trace_reader *reader;
    struct trace_record record;
    struct session_output output;
    struct touches touches = {0};
    CHECK(trace_reader_create(trace, &reader, NULL) == RESULT_OK);
    struct rerun *rerun = rerun_create(scene, &trace_reader_header(reader)->settings);
    while (trace_read(reader, &record, NULL) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        rerun_step(rerun, &record, &output);
        const struct landed *landed = &output.landed;
        if (landed->job && landed->outcome == JOB_DONE && touches.of[landed->tissue])
            compare_map(parts, group_of(scene, landed->tissue), landed->job,
                        touches.of[landed->tissue], touches.width[landed->tissue], r);
        if (output.job.id)
            remember(rerun_operation(rerun), scene, &touches);
    }
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    for (int i = 0; i < TISSUES_MAX; i++)
        free(touches.of[i]);
}
