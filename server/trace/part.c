#include "trace/part.h"

#include "base/check.h"
#include "trace/disk.h"

#include <unistd.h>

// ---- the new part -------------------------------------------------------------------------------

static enum result check(const struct trace_header *header, const struct trace_state *state,
                         struct error *err) {
    if (state->format != KEPT_FORMAT)
        return fail(err, RESULT_VERSION,
                    "the state is of format %u, and this program knows format %d", state->format,
                    KEPT_FORMAT);
    if (header->part < 2)
        return fail(err, RESULT_REFUSED, "part %u of a session begins with no state", header->part);
    if (state->place.rules != header->settings.rules)
        return fail(err, RESULT_REFUSED, "the state is of a session by other rules");
    return RESULT_OK;
}

static enum result append_state(struct trace_writer *writer, const uint8_t *bytes, size_t size,
                                struct error *err) {
    struct trace_state_part part = {.whole = (uint32_t)size};
    enum result result = RESULT_OK;
    for (size_t at = 0; at < size && result == RESULT_OK; at += part.size) {
        size_t left = size - at;
        part.offset = (uint32_t)at;
        part.size = (uint32_t)(left < STATE_PART_MAX ? left : STATE_PART_MAX);
        part.bytes = bytes + at;
        result = writer_append_state(writer, &part, err);
    }
    return result;
}

enum result trace_part_create(const char *path, const struct trace_header *header,
                              const uint8_t *bytes, size_t size, const struct trace_signer *signer,
                              const struct trace_tap *tap, struct trace_writer **out_writer,
                              struct error *err) {
    struct trace_state state;
    struct trace_writer *writer = NULL;
    enum result result = trace_state_parse(bytes, size, &state, err);
    if (result == RESULT_OK)
        result = check(header, &state, err);
    if (result == RESULT_OK)
        result = trace_writer_create(path, header, signer, tap, &writer, err);
    if (result != RESULT_OK)
        return result;
    result = append_state(writer, bytes, size, err);
    if (result != RESULT_OK) {
        trace_writer_leave(&writer);
        unlink(path);
        return result;
    }
    *out_writer = writer;
    return RESULT_OK;
}

// ---- the journal --------------------------------------------------------------------------------

// The last one asked for is the one that lands, for no two are on their way.
static bool take_landing(struct trace_journal *journal, const struct trace_record *tapped,
                         struct trace_record *out) {
    if (!tapped->job_done || journal->asked.id != tapped->input.job)
        return false;
    out->type = TRACE_TAKEN;
    out->output.job = journal->asked;
    return true;
}

static bool take_step(struct trace_journal *journal, const struct trace_record *tapped,
                      struct trace_record *out) {
    if (tapped->input.kind == INPUT_JOB)
        return take_landing(journal, tapped, out);
    out->type = TRACE_PAST;
    return input_is_command(tapped->input.kind);
}

bool trace_journal_take(struct trace_journal *journal, const struct trace_record *tapped,
                        struct trace_record *out) {
    *out = *tapped;
    if (tapped->type != TRACE_STEP)
        return true;
    bool is_kept = take_step(journal, tapped, out);
    if (tapped->output.job.id)
        journal->asked = tapped->output.job;
    return is_kept;
}

bool trace_journal_outlasts_state(enum trace_record_type type) {
    return type == TRACE_REMARK || type == TRACE_MARKER || type == TRACE_BEGUN ||
           type == TRACE_ENDED;
}

// ---- header and records as bytes ----------------------------------------------------------------

_Static_assert(TRACE_HEADER_PACKED_MAX >= HEADER_MAX, "a header fits with its hash");

size_t trace_header_pack(const struct trace_header *header, uint8_t *out) {
    return header_encode(header, NULL, out);
}

enum result trace_header_unpack(const uint8_t *bytes, size_t size, struct trace_header *out,
                                struct error *err) {
    unsigned version;
    size_t rest;
    if (size < HEADER_PREFIX)
        return fail(err, RESULT_FORMAT, "it ends within its header");
    enum result result = header_decode_prefix(bytes, &version, &rest, err);
    if (result == RESULT_OK && size != HEADER_PREFIX + rest)
        result = fail(err, RESULT_FORMAT, "its header has not the size that it tells");
    return result == RESULT_OK ? header_decode_bare(bytes, size, version, out, err) : result;
}

_Static_assert(TRACE_PACKED_MAX >= RECORD_MAX, "a record fits with its hash, which is left out");

size_t trace_record_pack(const struct trace_record *record, int rules, uint8_t *out) {
    size_t size = 0;
    switch (record->type) {
    case TRACE_REMARK:
        size = record_encode_remark(&record->remark, NULL, out);
        break;
    case TRACE_MARKER:
        size = record_encode_marker(&record->marker, NULL, out);
        break;
    case TRACE_BEGUN:
        size = record_encode_begun(&record->begun, NULL, out);
        break;
    case TRACE_ENDED:
        size = record_encode_ended(&record->ended, NULL, out);
        break;
    case TRACE_TOUCH:
        size = record_encode_touch(&record->touch_part, NULL, out);
        break;
    case TRACE_PAST:
        size = record_encode_past(&record->input, record->job_done, NULL, out);
        break;
    default:
        CHECK(record->type == TRACE_TAKEN);
        size = record_encode_taken(record, rules, NULL, out);
    }
    return size - TRACE_HASH_SIZE;
}

static bool can_be_packed(unsigned type) {
    return trace_journal_outlasts_state((enum trace_record_type)type) || type == TRACE_TOUCH ||
           type == TRACE_PAST || type == TRACE_TAKEN;
}

enum result trace_record_unpack(const uint8_t *bytes, size_t size, int rules, size_t *at,
                                struct trace_record *out, struct error *err) {
    struct trace_layout layout = {.version = TRACE_VERSION, .rules = rules};
    size_t left = *at < size ? size - *at : 0, rest;
    if (!left)
        return fail(err, RESULT_CLOSED, "all is read");
    if (left < RECORD_PREFIX)
        return fail(err, RESULT_FORMAT, "it ends within a record");
    enum result result = record_decode_prefix(bytes + *at, TRACE_VERSION, &rest, err);
    if (result != RESULT_OK)
        return result;
    rest += RECORD_PREFIX - TRACE_HASH_SIZE;
    unsigned type = bytes[*at + RECORD_PREFIX - 1];
    if (rest > left)
        return fail(err, RESULT_FORMAT, "it ends within a record");
    if (!can_be_packed(type))
        return fail(err, RESULT_FORMAT, "a record of type %u is none of a journal", type);
    result = record_decode_bare(bytes + *at, rest, layout, out, NULL, err);
    if (result == RESULT_OK && type == TRACE_PAST && !input_is_command(out->input.kind))
        return fail(err, RESULT_FORMAT, "a past input is no command");
    *at += result == RESULT_OK ? rest : 0;
    out->is_packed = true;
    return result;
}
