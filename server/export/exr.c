#include "base/check.h"
#include "export/contents.h"
#include "export/describe.h"
#include "export/image.h"
#include "export/inputs.h"
#include "export/maps.h"

#include <stdlib.h>
#include <string.h>

#define WIDTH 1024 // pixels of a row, one for each step
#define TIME_CHANNELS 2
#define OWNERS_MAX (2 + INSTRUMENT_COUNT + 2)
#define OWNER_INPUT INSTRUMENT_COUNT // beside those of step/fields.h

// A part of the file with a pixel for each step, or for each that has a job or a landing.
struct sheet {
    int owner;
    uint64_t pixels;
    uint32_t width, height;
    int field_count;
    int first_input; // from here on they are of inputs
    struct step_field fields[STEP_FIELDS_MAX];
    int channel_count;
};

// ---- channels -----------------------------------------------------------------------------------

// NAME as a float, and its bits where a float may not hold them.
static int field_channels(const struct step_field *field, struct image_channel *out) {
    int count = step_field_size(field) == 8 ? 3 : step_field_size(field) == 4 ? 2 : 1;
    static const char *const endings[] = {"", ".low", ".high"};
    for (int i = 0; i < count; i++) {
        snprintf(out[i].name, sizeof out[i].name, "%s%s", field->name, endings[i]);
        out[i].type = i ? IMAGE_UINT : IMAGE_FLOAT;
    }
    return count;
}

static void declare_sheet(struct sheet *sheet, const char *name, struct image_writer *writer) {
    struct image_channel *channels = alloc(TIME_CHANNELS + 3 * STEP_FIELDS_MAX, sizeof *channels);
    channels[0] = (struct image_channel){"t_seconds", IMAGE_FLOAT};
    channels[1] = (struct image_channel){"t_seconds.rest", IMAGE_FLOAT};
    sheet->channel_count = TIME_CHANNELS;
    for (int i = 0; i < sheet->field_count; i++)
        sheet->channel_count += field_channels(&sheet->fields[i], channels + sheet->channel_count);
    int part = image_writer_part(writer, name, sheet->width, sheet->height, channels,
                                 sheet->channel_count);
    image_writer_number(writer, part, "arthron:pixels", (double)sheet->pixels);
    free(channels);
}

// ---- pixels -------------------------------------------------------------------------------------

static bool has_pixel(const struct sheet *sheet, const struct session_output *output) {
    switch (sheet->owner) {
    case OWNER_JOB:
        return output->job.id != 0;
    case OWNER_LANDED:
        return output->landed.job != 0;
    default:
        return true;
    }
}

static void fill_pixel(const struct sheet *sheet, const struct trace_record *record, double seconds,
                       uint32_t *values) {
    size_t width = sheet->width;
    struct input_row row;
    if (sheet->owner == OWNER_INPUT)
        input_row_of(record, &row);
    values[0] = image_float((float)seconds);
    values[width] = image_float((float)(seconds - (double)(float)seconds));
    values += TIME_CHANNELS * width;
    for (int i = 0; i < sheet->field_count; i++) {
        const struct step_field *field = &sheet->fields[i];
        bool is_input = i >= sheet->first_input;
        const void *of = is_input ? (const void *)&row : &record->output;
        bool there = is_input ? input_field_is_there(field, &row)
                              : step_field_is_there(field, &record->output);
        uint32_t words[2];
        image_split(there ? step_field_bits(field, of) : 0, &words[0], &words[1]);
        *values = image_float(there ? (float)step_field_number(field, of) : NAN);
        values += width;
        for (size_t word = 0; word < step_field_size(field) / 4; word++, values += width)
            *values = words[word];
    }
}

// What is no step: not a number, and no bits.
static void clear_row(const struct sheet *sheet, uint32_t *values) {
    memset(values, 0, (size_t)sheet->channel_count * sheet->width * sizeof *values);
    uint32_t *channel = values;
    for (int i = -TIME_CHANNELS; i < sheet->field_count; i++) {
        for (uint32_t x = 0; x < sheet->width; x++)
            channel[x] = image_float(NAN);
        channel += sheet->width * (1 + (i < 0 ? 0 : step_field_size(&sheet->fields[i]) / 4));
    }
}

// A sheet as it is filled, row by row.
struct filling {
    const struct sheet *sheet;
    struct image_writer *writer;
    uint32_t x, y;
    uint32_t *values; // of the row
};

static void end_row(struct filling *f) {
    image_writer_row(f->writer, f->values);
    clear_row(f->sheet, f->values);
    f->x = 0;
    f->y++;
}

static bool on_image_step(void *user, const struct trace_record *record, double seconds) {
    struct filling *f = user;
    if (!has_pixel(f->sheet, &record->output))
        return true;
    fill_pixel(f->sheet, record, seconds, f->values + f->x++);
    if (f->x == f->sheet->width)
        end_row(f);
    return f->y < f->sheet->height && image_writer_is_good(f->writer);
}

static enum result write_sheet(const struct sheet *sheet, struct walk *walk,
                               const struct contents *contents, struct image_writer *writer,
                               struct error *err) {
    struct filling f = {.sheet = sheet, .writer = writer};
    f.values = alloc((size_t)sheet->channel_count * sheet->width, sizeof *f.values);
    clear_row(sheet, f.values);
    enum result result = walk_run(walk, contents, on_image_step, &f, err);
    while (result == RESULT_OK && f.y < sheet->height)
        end_row(&f);
    free(f.values);
    return result;
}

// ---- which sheets -------------------------------------------------------------------------------

struct exr {
    struct contents contents;
    struct walk walk;
    struct maps *maps; // or NULL
    int sheet_count;
    struct sheet *sheets;
};

static bool names_the_step(const struct step_field *field) {
    return !strcmp(field->name, "step") || !strcmp(field->name, "time_ns");
}

static void add_sheet(struct exr *exr, int owner, uint64_t pixels) {
    struct step_field fields[STEP_FIELDS_MAX];
    int count = contents_fields(&exr->contents, fields);
    struct sheet *sheet = &exr->sheets[exr->sheet_count++];
    sheet->owner = owner;
    sheet->pixels = pixels;
    sheet->width = pixels >= WIDTH ? WIDTH : pixels ? (uint32_t)pixels : 1;
    sheet->height = pixels ? (uint32_t)((pixels + sheet->width - 1) / sheet->width) : 1;
    for (int i = 0; i < count; i++)
        if (step_field_part(&fields[i]) == owner || names_the_step(&fields[i]))
            sheet->fields[sheet->field_count++] = fields[i];
    sheet->first_input = sheet->field_count;
    if (owner == OWNER_INPUT)
        sheet->field_count +=
            input_fields(exr->contents.sampled, sheet->fields + sheet->field_count);
}

static void choose_sheets(struct exr *exr) {
    const struct contents *contents = &exr->contents;
    exr->sheets = alloc(OWNERS_MAX, sizeof *exr->sheets);
    add_sheet(exr, OWNER_STEP, contents->steps);
    add_sheet(exr, OWNER_INPUT, contents->steps);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (contents->present[i])
            add_sheet(exr, i, contents->steps);
    if (contents->jobs)
        add_sheet(exr, OWNER_JOB, contents->jobs);
    if (contents->landed)
        add_sheet(exr, OWNER_LANDED, contents->landed);
}

static const char *sheet_name(const struct sheet *sheet) {
    switch (sheet->owner) {
    case OWNER_STEP:
        return "steps";
    case OWNER_INPUT:
        return "inputs";
    case OWNER_JOB:
        return "jobs";
    case OWNER_LANDED:
        return "landed";
    default:
        return channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + sheet->owner));
    }
}

// ---- the file -----------------------------------------------------------------------------------

static enum result write_all(struct exr *exr, const char *path, struct error *err) {
    struct image_writer *writer = image_writer_create(path);
    enum result result = RESULT_OK;
    for (int i = 0; i < exr->sheet_count; i++)
        declare_sheet(&exr->sheets[i], sheet_name(&exr->sheets[i]), writer);
    exr_describe(&exr->contents, writer);
    if (exr->maps)
        maps_declare(exr->maps, writer);
    for (int i = 0; i < exr->sheet_count && result == RESULT_OK; i++)
        result = write_sheet(&exr->sheets[i], &exr->walk, &exr->contents, writer, err);
    if (exr->maps && result == RESULT_OK)
        maps_write(exr->maps, writer);
    if (result != RESULT_OK)
        image_writer_abandon(&writer);
    return result == RESULT_OK ? image_writer_finish(&writer, err) : result;
}

enum result export_exr(const struct export_request *request, const char *path, struct error *err) {
    struct exr exr = {.walk = {.request = request}};
    enum result result = contents_read(request, &exr.contents, err);
    if (result != RESULT_OK)
        return result;
    choose_sheets(&exr);
    exr.walk.passes = exr.sheet_count + (request->scene != NULL);
    if (exr.contents.steps / WIDTH >= IMAGE_SIDE_MAX)
        result = fail(err, RESULT_LIMIT, "%llu steps are more than an image holds",
                      (unsigned long long)exr.contents.steps);
    if (result == RESULT_OK && request->scene)
        result = maps_create(&exr.walk, &exr.maps, err);
    if (result == RESULT_OK)
        result = write_all(&exr, path, err);
    maps_destroy(&exr.maps);
    free(exr.sheets);
    return result == RESULT_OK ? contents_end(&exr.contents, err) : result;
}
