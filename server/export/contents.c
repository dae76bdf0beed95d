#include "export/contents.h"

#include "base/clock.h"

#include <string.h>

static double seconds_of(const struct trace_reader *reader, const struct session_output *output) {
    return (double)(output->time_ns - trace_reader_header(reader)->start_ns) / (double)NS_PER_S;
}

// The next step within the time asked for.
static enum result next_step(const struct export_request *request, struct trace_reader *reader,
                             struct trace_record *record, double *out_seconds, struct error *err) {
    enum result result;
    while ((result = trace_read(reader, record, err)) == RESULT_OK) {
        if (record->type != TRACE_STEP)
            continue;
        *out_seconds = seconds_of(reader, &record->output);
        if (*out_seconds >= request->from_s && *out_seconds <= request->to_s)
            break;
    }
    return result;
}

enum result contents_read(const struct export_request *request, struct contents *contents,
                          struct error *err) {
    struct trace_reader *reader;
    struct trace_record record;
    double seconds;
    memset(contents, 0, sizeof *contents);
    enum result result = trace_reader_create(request->trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    contents->header = *trace_reader_header(reader);
    while ((contents->end = next_step(request, reader, &record, &seconds, &contents->why)) ==
           RESULT_OK) {
        contents->steps++;
        contents->jobs += record.output.job.id != 0;
        if (record.output.job.move_count > contents->moves)
            contents->moves = record.output.job.move_count;
        contents->landed += record.output.landed.job != 0;
        for (int i = 0; i < INSTRUMENT_COUNT; i++)
            contents->present[i] |= record.output.instruments[i].present;
    }
    memcpy(contents->hash, trace_reader_place(reader).hash, sizeof contents->hash);
    trace_reader_destroy(&reader);
    return RESULT_OK;
}

enum result contents_end(const struct contents *contents, struct error *err) {
    if (contents->end == RESULT_CLOSED)
        return RESULT_OK;
    return fail(err, contents->end, "%s", contents->why.text);
}

void bytes_text(const uint8_t *bytes, size_t count, char *out_text) {
    for (size_t i = 0; i < count; i++)
        snprintf(out_text + 2 * i, 3, "%02x", bytes[i]);
}

static bool ever_there(const struct step_field *field, const struct contents *contents) {
    if (field->owner <= OWNER_MOVE)
        return OWNER_MOVE - field->owner < contents->moves;
    switch (step_field_part(field)) {
    case OWNER_STEP:
        return true;
    case OWNER_JOB:
    case OWNER_LANDED:
        return contents->jobs > 0;
    default:
        return contents->present[field->owner];
    }
}

int contents_fields(const struct contents *contents,
                    struct step_field out_fields[STEP_FIELDS_MAX]) {
    struct step_field all[STEP_FIELDS_MAX];
    int count = 0, all_count = step_fields(all);
    for (int i = 0; i < all_count; i++)
        if (ever_there(&all[i], contents))
            out_fields[count++] = all[i];
    return count;
}

enum result walk_begin(struct walk *walk, const struct contents *contents, struct error *err) {
    walk->left = contents->steps;
    return trace_reader_create(walk->request->trace, &walk->reader, err);
}

bool walk_next(struct walk *walk, struct trace_record *record, double *out_seconds) {
    if (!walk->left || next_step(walk->request, walk->reader, record, out_seconds, NULL))
        return false;
    walk->left--;
    uint64_t size = trace_reader_size(walk->reader);
    if (walk->request->progress)
        walk->request->progress((uint64_t)walk->pass * size + trace_reader_offset(walk->reader),
                                (uint64_t)walk->passes * size);
    return true;
}

void walk_end(struct walk *walk) {
    uint64_t size = trace_reader_size(walk->reader);
    walk->pass++;
    if (walk->request->progress)
        walk->request->progress((uint64_t)walk->pass * size, (uint64_t)walk->passes * size);
    trace_reader_destroy(&walk->reader);
}
