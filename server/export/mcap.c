#include "export/mcap.h"

#include "base/check.h"
#include "base/draft.h"
#include "export/mcap_bytes.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#define CHUNK_BYTES (1 << 20) // a chunk ends after the message that makes it so long

enum opcode {
    OP_HEADER = 0x01,
    OP_FOOTER = 0x02,
    OP_SCHEMA = 0x03,
    OP_CHANNEL = 0x04,
    OP_MESSAGE = 0x05,
    OP_CHUNK = 0x06,
    OP_MESSAGE_INDEX = 0x07,
    OP_CHUNK_INDEX = 0x08,
    OP_STATISTICS = 0x0B,
    OP_METADATA = 0x0C,
    OP_METADATA_INDEX = 0x0D,
    OP_SUMMARY_OFFSET = 0x0E,
    OP_DATA_END = 0x0F
};

static const uint8_t magic[8] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

struct channel_index {
    struct mcap_bytes places; // of its messages in the chunk: time and offset
    uint64_t count;           // in the file
};

struct mcap {
    struct draft draft;
    uint64_t offset; // in the file
    // For the summary: records that say again what there is.
    struct mcap_bytes schemas, channels, metadata_indexes, chunk_indexes;
    uint16_t schema_count, channel_count;
    uint32_t metadata_count, chunk_count;
    struct channel_index *indexes; // by channel
    struct mcap_bytes chunk;       // the messages of the chunk that is open
    uint64_t chunk_first_ns, chunk_last_ns;
    uint64_t message_count, first_ns, last_ns;
};

static void write_out(struct mcap *m, const void *data, size_t size) {
    if (!m->draft.trouble && fwrite(data, 1, size, m->draft.file) != size)
        draft_is_good(&m->draft);
    m->offset += size;
}

// Writes it as it is and empties it.
static void write_record(struct mcap *m, struct mcap_bytes *record) {
    write_out(m, record->data, record->size);
    mcap_bytes_fini(record);
}

// ---- what a file begins with --------------------------------------------------------------------

enum result mcap_create(const char *path, const char *library, struct mcap **out_mcap,
                        struct error *err) {
    struct mcap *m = alloc(1, sizeof *m);
    enum result result = draft_open(path, &m->draft, err);
    if (result != RESULT_OK) {
        free(m);
        return result;
    }
    struct mcap_bytes header = {0};
    size_t begun = mcap_begin_record(&header, OP_HEADER);
    mcap_put_text(&header, ""); // of no profile
    mcap_put_text(&header, library);
    mcap_end_record(&header, begun);
    write_out(m, magic, sizeof magic);
    write_record(m, &header);
    *out_mcap = m;
    return RESULT_OK;
}

static void put_pairs(struct mcap_bytes *bytes, const char *const *pairs, int pair_count) {
    size_t begun = mcap_begin_sized(bytes, 4);
    for (int i = 0; i < 2 * pair_count; i++)
        mcap_put_text(bytes, pairs[i]);
    mcap_end_sized(bytes, begun, 4);
}

void mcap_metadata(struct mcap *m, const char *name, const char *const *pairs, int pair_count) {
    CHECK(m->message_count == 0);
    struct mcap_bytes record = {0};
    size_t begun = mcap_begin_record(&record, OP_METADATA);
    mcap_put_text(&record, name);
    put_pairs(&record, pairs, pair_count);
    mcap_end_record(&record, begun);
    begun = mcap_begin_record(&m->metadata_indexes, OP_METADATA_INDEX);
    mcap_put_number(&m->metadata_indexes, m->offset, 8);
    mcap_put_number(&m->metadata_indexes, record.size, 8);
    mcap_put_text(&m->metadata_indexes, name);
    mcap_end_record(&m->metadata_indexes, begun);
    m->metadata_count++;
    write_record(m, &record);
}

uint16_t mcap_schema(struct mcap *m, const char *name, const uint8_t *data, size_t size) {
    CHECK(m->message_count == 0 && m->schema_count < UINT16_MAX);
    size_t at = m->schemas.size, begun = mcap_begin_record(&m->schemas, OP_SCHEMA);
    mcap_put_number(&m->schemas, ++m->schema_count, 2);
    mcap_put_text(&m->schemas, name);
    mcap_put_text(&m->schemas, "protobuf");
    mcap_put_number(&m->schemas, size, 4);
    mcap_put(&m->schemas, data, size);
    mcap_end_record(&m->schemas, begun);
    write_out(m, m->schemas.data + at, m->schemas.size - at);
    return m->schema_count;
}

uint16_t mcap_channel(struct mcap *m, uint16_t schema, const char *topic) {
    CHECK(m->message_count == 0 && m->channel_count < UINT16_MAX);
    size_t at = m->channels.size, begun = mcap_begin_record(&m->channels, OP_CHANNEL);
    mcap_put_number(&m->channels, m->channel_count, 2);
    mcap_put_number(&m->channels, schema, 2);
    mcap_put_text(&m->channels, topic);
    mcap_put_text(&m->channels, "protobuf");
    put_pairs(&m->channels, NULL, 0);
    mcap_end_record(&m->channels, begun);
    write_out(m, m->channels.data + at, m->channels.size - at);
    m->indexes = alloc_resize(m->indexes, (size_t)m->channel_count + 1, sizeof *m->indexes);
    m->indexes[m->channel_count] = (struct channel_index){0};
    return m->channel_count++;
}

// ---- chunks -------------------------------------------------------------------------------------

static void write_chunk_record(struct mcap *m) {
    struct mcap_bytes head = {0};
    const struct mcap_bytes *chunk = &m->chunk;
    uint64_t rest = 8 + 8 + 8 + 4 + 4 + 8 + chunk->size;
    mcap_put_number(&head, OP_CHUNK, 1);
    mcap_put_number(&head, rest, 8);
    mcap_put_number(&head, m->chunk_first_ns, 8);
    mcap_put_number(&head, m->chunk_last_ns, 8);
    mcap_put_number(&head, chunk->size, 8);
    mcap_put_number(&head, crc32_z(0, chunk->data, chunk->size), 4);
    mcap_put_text(&head, ""); // not compressed
    mcap_put_number(&head, chunk->size, 8);
    write_record(m, &head);
    write_out(m, chunk->data, chunk->size);
}

// Writes the index of each channel that has messages in the chunk, and where it is.
static void write_message_indexes(struct mcap *m, struct mcap_bytes *out_places) {
    for (int i = 0; i < m->channel_count; i++) {
        struct mcap_bytes *places = &m->indexes[i].places, record = {0};
        if (!places->size)
            continue;
        mcap_put_number(out_places, (uint64_t)i, 2);
        mcap_put_number(out_places, m->offset, 8);
        size_t begun = mcap_begin_record(&record, OP_MESSAGE_INDEX);
        mcap_put_number(&record, (uint64_t)i, 2);
        mcap_put_number(&record, places->size, 4);
        mcap_put(&record, places->data, places->size);
        mcap_end_record(&record, begun);
        write_record(m, &record);
        places->size = 0;
    }
}

static void end_chunk(struct mcap *m) {
    if (!m->chunk.size)
        return;
    struct mcap_bytes places = {0}, *index = &m->chunk_indexes;
    uint64_t at = m->offset;
    write_chunk_record(m);
    uint64_t indexes_at = m->offset;
    write_message_indexes(m, &places);
    size_t begun = mcap_begin_record(index, OP_CHUNK_INDEX);
    mcap_put_number(index, m->chunk_first_ns, 8);
    mcap_put_number(index, m->chunk_last_ns, 8);
    mcap_put_number(index, at, 8);
    mcap_put_number(index, indexes_at - at, 8);
    mcap_put_number(index, places.size, 4);
    mcap_put(index, places.data, places.size);
    mcap_put_number(index, m->offset - indexes_at, 8);
    mcap_put_text(index, ""); // not compressed
    mcap_put_number(index, m->chunk.size, 8);
    mcap_put_number(index, m->chunk.size, 8);
    mcap_end_record(index, begun);
    mcap_bytes_fini(&places);
    m->chunk_count++;
    m->chunk.size = 0;
}

static void widen(uint64_t *first_ns, uint64_t *last_ns, uint64_t time_ns, bool is_first) {
    if (is_first || time_ns < *first_ns)
        *first_ns = time_ns;
    if (is_first || time_ns > *last_ns)
        *last_ns = time_ns;
}

void mcap_message(struct mcap *m, uint16_t channel, uint64_t time_ns, const uint8_t *data,
                  size_t size) {
    CHECK(channel < m->channel_count);
    struct channel_index *index = &m->indexes[channel];
    widen(&m->chunk_first_ns, &m->chunk_last_ns, time_ns, m->chunk.size == 0);
    widen(&m->first_ns, &m->last_ns, time_ns, m->message_count == 0);
    mcap_put_number(&index->places, time_ns, 8);
    mcap_put_number(&index->places, m->chunk.size, 8);
    size_t begun = mcap_begin_record(&m->chunk, OP_MESSAGE);
    mcap_put_number(&m->chunk, channel, 2);
    mcap_put_number(&m->chunk, index->count, 4); // its number in the channel
    mcap_put_number(&m->chunk, time_ns, 8);
    mcap_put_number(&m->chunk, time_ns, 8); // published when it was recorded
    mcap_put(&m->chunk, data, size);
    mcap_end_record(&m->chunk, begun);
    index->count++;
    m->message_count++;
    if (m->chunk.size >= CHUNK_BYTES)
        end_chunk(m);
}

// ---- what a file ends with ----------------------------------------------------------------------

static void put_statistics(const struct mcap *m, struct mcap_bytes *out) {
    size_t begun = mcap_begin_record(out, OP_STATISTICS);
    mcap_put_number(out, m->message_count, 8);
    mcap_put_number(out, m->schema_count, 2);
    mcap_put_number(out, m->channel_count, 4);
    mcap_put_number(out, 0, 4); // attachments
    mcap_put_number(out, m->metadata_count, 4);
    mcap_put_number(out, m->chunk_count, 4);
    mcap_put_number(out, m->first_ns, 8);
    mcap_put_number(out, m->last_ns, 8);
    size_t counts = mcap_begin_sized(out, 4);
    for (int i = 0; i < m->channel_count; i++) {
        mcap_put_number(out, (uint64_t)i, 2);
        mcap_put_number(out, m->indexes[i].count, 8);
    }
    mcap_end_sized(out, counts, 4);
    mcap_end_record(out, begun);
}

// The records of each kind, then where each kind begins.
static size_t put_summary(const struct mcap *m, struct mcap_bytes *out) {
    struct mcap_bytes statistics = {0};
    put_statistics(m, &statistics);
    const struct {
        enum opcode opcode;
        const struct mcap_bytes *records;
    } groups[] = {{OP_SCHEMA, &m->schemas},
                  {OP_CHANNEL, &m->channels},
                  {OP_STATISTICS, &statistics},
                  {OP_CHUNK_INDEX, &m->chunk_indexes},
                  {OP_METADATA_INDEX, &m->metadata_indexes}};
    enum { GROUPS = sizeof groups / sizeof *groups };
    for (int i = 0; i < GROUPS; i++)
        mcap_put(out, groups[i].records->data, groups[i].records->size);
    uint64_t at = m->offset;
    size_t offsets = out->size;
    for (int i = 0; i < GROUPS; i++) {
        if (!groups[i].records->size)
            continue;
        size_t begun = mcap_begin_record(out, OP_SUMMARY_OFFSET);
        mcap_put_number(out, groups[i].opcode, 1);
        mcap_put_number(out, at, 8);
        mcap_put_number(out, groups[i].records->size, 8);
        mcap_end_record(out, begun);
        at += groups[i].records->size;
    }
    mcap_bytes_fini(&statistics);
    return offsets;
}

static void write_end(struct mcap *m) {
    struct mcap_bytes end = {0}, summary = {0};
    size_t begun = mcap_begin_record(&end, OP_DATA_END);
    mcap_put_number(&end, 0, 4); // no checksum of all: each chunk has one
    mcap_end_record(&end, begun);
    write_record(m, &end);
    size_t offsets = put_summary(m, &summary);
    mcap_put_number(&summary, OP_FOOTER, 1);
    mcap_put_number(&summary, 8 + 8 + 4, 8);
    mcap_put_number(&summary, m->offset, 8);
    mcap_put_number(&summary, m->offset + offsets, 8);
    mcap_put_number(&summary, crc32_z(0, summary.data, summary.size), 4);
    write_record(m, &summary);
    write_out(m, magic, sizeof magic);
}

static void release_mcap(struct mcap **mcap) {
    struct mcap *m = *mcap;
    for (int i = 0; i < m->channel_count; i++)
        mcap_bytes_fini(&m->indexes[i].places);
    free(m->indexes);
    mcap_bytes_fini(&m->chunk);
    mcap_bytes_fini(&m->schemas);
    mcap_bytes_fini(&m->channels);
    mcap_bytes_fini(&m->metadata_indexes);
    mcap_bytes_fini(&m->chunk_indexes);
    free(m);
    *mcap = NULL;
}

enum result mcap_finish(struct mcap **mcap, struct error *err) {
    end_chunk(*mcap);
    write_end(*mcap);
    enum result result = draft_keep(&(*mcap)->draft, err);
    release_mcap(mcap);
    return result;
}

void mcap_abandon(struct mcap **mcap) {
    draft_drop(&(*mcap)->draft);
    release_mcap(mcap);
}
