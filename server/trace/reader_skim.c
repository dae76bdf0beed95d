#include "base/bytes.h"
#include "base/check.h"
#include "trace/reader_parts.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define STEP_END (8 + TRACE_HASH_SIZE) // of its record: the hash of its output, and the record's

enum result trace_reader_skim(struct trace_reader *r, const struct trace_place *to,
                              uint64_t output_hash, struct error *err) {
    uint8_t end[STEP_END];
    if (to->offset < r->place.offset + STEP_END || to->offset > r->size)
        return fail(err, RESULT_REFUSED, "%s: it is shorter", r->path);
    if (pread(fileno(r->file), end, sizeof end, (off_t)(to->offset - STEP_END)) != STEP_END)
        return reader_unreadable(r, err);
    struct reader bytes = {end, sizeof end, 0, false};
    bool fits = read_u64(&bytes) == output_hash && !memcmp(end + 8, to->hash, sizeof to->hash);
    if (!fits || to->version != r->place.version || to->rules != r->place.rules)
        return fail(err, RESULT_REFUSED, "%s: no such step ends there", r->path);
    r->skim_to = *to;
    r->skims = true;
    return RESULT_OK;
}

static bool is_where_it_ends(const struct trace_reader *r) {
    const struct trace_place *to = &r->skim_to;
    return r->place.offset == to->offset && r->place.step == to->step &&
           r->place.records == to->records && r->place.missing == to->missing &&
           r->place.past == to->past && r->place.time_ns == to->time_ns;
}

// ---- hopping from record to record --------------------------------------------------------------

#define BLOCK ((size_t)1 << 18)

struct block {
    int fd;
    uint8_t *bytes;
    uint64_t from; // in the file
    size_t size;
};

// The bytes at a place, up to a record's worth of them, as far as the file goes.
static const uint8_t *look_at_block(struct block *b, uint64_t at, size_t *out_left) {
    if (at + RECORD_MAX > b->from + b->size) {
        ssize_t got = pread(b->fd, b->bytes, BLOCK, (off_t)at);
        b->from = at;
        b->size = got > 0 ? (size_t)got : 0;
    }
    *out_left = b->size - (size_t)(at - b->from);
    return b->bytes + (at - b->from);
}

static bool is_passed_over(unsigned type) {
    return type == TRACE_STEP || type == TRACE_PAST || type == TRACE_TOUCH || type == TRACE_TAKEN;
}

// False: it is of another type, or not whole.
static bool pass_over(struct trace_reader *r, const uint8_t *record, size_t left) {
    struct trace_place *place = &r->place;
    struct error none;
    size_t rest;
    if (left < RECORD_PREFIX || !is_passed_over(record[RECORD_PREFIX - 1]) ||
        record_decode_prefix(record, r->header.version, &rest, &none) != RESULT_OK ||
        rest < 9 + TRACE_HASH_SIZE || rest > left - RECORD_PREFIX)
        return false;
    unsigned type = record[RECORD_PREFIX - 1];
    place->offset += RECORD_PREFIX + rest;
    memcpy(r->chain.value, record + RECORD_PREFIX + rest - TRACE_HASH_SIZE, TRACE_HASH_SIZE);
    if (type == TRACE_TOUCH)
        return true;
    size_t kind = type != TRACE_TAKEN; // of its input, before the time
    struct reader bytes = {record, left, RECORD_PREFIX + kind, false};
    place->step++;
    place->records += type == TRACE_STEP;
    place->past += type != TRACE_STEP;
    place->time_ns = read_i64(&bytes);
    return true;
}

enum result reader_hop(struct trace_reader *r, struct error *err) {
    bool is_before = r->header.part > 1 && !r->beginning.is_read;
    if (!r->skims || is_before || (r->attempted && r->place.offset < r->skim_to.offset))
        return RESULT_OK;
    struct block block = {fileno(r->file), alloc(BLOCK, 1), 0, 0};
    size_t left;
    const uint8_t *record;
    do
        record = look_at_block(&block, r->place.offset, &left);
    while (r->place.offset < r->skim_to.offset && pass_over(r, record, left));
    free(block.bytes);
    bool ends = r->place.offset >= r->skim_to.offset;
    if (ends && !is_where_it_ends(r))
        return fail(err, RESULT_CORRUPT, "it has other steps than it had");
    r->skims = !ends;
    return fseeko(r->file, (off_t)r->place.offset, SEEK_SET) == 0 ? RESULT_OK
                                                                  : reader_unreadable(r, err);
}
