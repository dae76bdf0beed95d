#include "base/check.h"
#include "trace/record.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

struct trace_reader {
    FILE *file;
    char *path;
    uint64_t offset, size;
    struct trace_header header;
    uint64_t step;     // of the last record, gaps counted
    uint64_t records;  // steps read
    int64_t time_ns;   // of the last step, 0 before the first: where a session's clock begins
    bool ended;        // the end record was read
    enum result state; // anything but OK: reading has ended so
    struct error why;
};

// Reads exactly `size` bytes; RESULT_MISSING where the file has no more.
static enum result read_exactly(struct trace_reader *r, void *out, size_t size, struct error *err) {
    size_t got = fread(out, 1, size, r->file);
    if (got == size)
        return RESULT_OK;
    if (ferror(r->file))
        return fail(err, RESULT_IO, "%s", strerror(errno));
    return fail(err, RESULT_MISSING, "it ends too early");
}

static enum result read_header(struct trace_reader *r, struct error *err) {
    uint8_t data[HEADER_MAX];
    size_t rest = 0;
    enum result result = read_exactly(r, data, HEADER_PREFIX, err);
    if (result == RESULT_OK)
        result = header_decode_prefix(data, &rest, err);
    if (result == RESULT_OK)
        result = read_exactly(r, data + HEADER_PREFIX, rest, err);
    if (result == RESULT_OK)
        result = header_decode(data, HEADER_PREFIX + rest, &r->header, err);
    r->offset = HEADER_PREFIX + rest;
    if (result != RESULT_OK)
        return fail_in(err, result, "%s, header: ", r->path);
    return RESULT_OK;
}

enum result trace_reader_create(const char *path, struct trace_reader **out_reader,
                                struct error *err) {
    FILE *file = fopen(path, "rbe");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    struct trace_reader *r = alloc(1, sizeof *r);
    r->file = file;
    r->path = alloc_text(path);
    struct stat status;
    if (fstat(fileno(file), &status) == 0)
        r->size = (uint64_t)status.st_size;
    enum result result = read_header(r, err);
    if (result != RESULT_OK) {
        trace_reader_destroy(&r);
        return result;
    }
    *out_reader = r;
    return RESULT_OK;
}

void trace_reader_destroy(struct trace_reader **reader) {
    if (!*reader)
        return;
    fclose((*reader)->file);
    free((*reader)->path);
    free(*reader);
    *reader = NULL;
}

const struct trace_header *trace_reader_header(const struct trace_reader *r) {
    return &r->header;
}

uint64_t trace_reader_offset(const struct trace_reader *r) {
    return r->offset;
}

uint64_t trace_reader_size(const struct trace_reader *r) {
    return r->size;
}

// What is right in itself must also follow from what came before.
static enum result follow(struct trace_reader *r, const struct trace_record *record,
                          struct error *err) {
    switch (record->type) {
    case TRACE_STEP:
        if (record->output.step != r->step + 1)
            return fail(err, RESULT_FORMAT, "step %llu comes after step %llu",
                        (unsigned long long)record->output.step, (unsigned long long)r->step);
        if (record->input.time_ns < r->time_ns)
            return fail(err, RESULT_FORMAT, "time falls at step %llu",
                        (unsigned long long)record->output.step);
        r->step++;
        r->records++;
        r->time_ns = record->input.time_ns;
        return RESULT_OK;
    case TRACE_GAP:
        r->step += record->missing;
        return RESULT_OK;
    default:
        if (record->records != r->records || record->missing != r->step - r->records)
            return fail(err, RESULT_FORMAT, "the end record counts other steps than there are");
        r->ended = true;
        return RESULT_OK;
    }
}

static enum result read_record(struct trace_reader *r, struct trace_record *out,
                               struct error *err) {
    uint8_t data[RECORD_MAX];
    if (r->ended)
        return fgetc(r->file) == EOF ? fail(err, RESULT_CLOSED, "all is read")
                                     : fail(err, RESULT_FORMAT, "there is more after its end");
    size_t rest;
    enum result result = read_exactly(r, data, RECORD_PREFIX, err);
    if (result == RESULT_OK)
        result = record_decode_prefix(data, &rest, err);
    if (result == RESULT_OK)
        result = read_exactly(r, data + RECORD_PREFIX, rest, err);
    if (result == RESULT_OK)
        result = record_decode(data, RECORD_PREFIX + rest, out, err);
    if (result == RESULT_OK)
        result = follow(r, out, err);
    if (result != RESULT_OK)
        return result;
    out->offset = r->offset;
    out->size = RECORD_PREFIX + rest;
    r->offset += out->size;
    return RESULT_OK;
}

enum result trace_read(struct trace_reader *r, struct trace_record *out, struct error *err) {
    if (r->state == RESULT_OK) {
        r->state = read_record(r, out, &r->why);
        if (r->state != RESULT_OK)
            fail_in(&r->why, r->state, "%s, byte %llu: ", r->path, (unsigned long long)r->offset);
    }
    if (r->state != RESULT_OK)
        return fail(err, r->state, "%s", r->why.text);
    return RESULT_OK;
}
