#include "wire/live.h"

#include <pb_common.h>
#include <pb_encode.h>
#include <string.h>

#define ITEMS_TAG 1      // of items in LiveBatch
#define LIVE_CHUNK_TAG 5 // of mesh_chunk in Live
#define PREFIX_MAX 9     // of an item: two tags, two lengths

_Static_assert((int)arthron_Live_resection_tag == LIVE_CHUNK_TAG - 1 &&
                   (int)arthron_Live_remark_tag == LIVE_CHUNK_TAG + 1,
               "the chunk is where the schema has it");
_Static_assert((int)arthron_Live_beat_tag < 16, "a tag takes one byte");

static size_t varint_size(size_t value) {
    size_t size = 1;
    for (; value >= 128; value >>= 7)
        size++;
    return size;
}

static bool put_prefix(pb_ostream_t *stream, uint32_t tag, size_t size) {
    return pb_encode_tag(stream, PB_WT_STRING, tag) && pb_encode_varint(stream, size);
}

// nanopb finds the length of a message by encoding it once more, at each level of nesting. Here its
// bytes are made first, and what goes before them then.
static enum result encode_live(uint32_t kind, const pb_msgdesc_t *fields, const void *message,
                               uint8_t *data, size_t size, size_t *out_used) {
    uint8_t prefix[PREFIX_MAX];
    if (size < PREFIX_MAX)
        return RESULT_LIMIT;
    pb_ostream_t inner = pb_ostream_from_buffer(data + PREFIX_MAX, size - PREFIX_MAX);
    pb_ostream_t outer = pb_ostream_from_buffer(prefix, sizeof prefix);
    if (!pb_encode(&inner, fields, message))
        return RESULT_LIMIT;
    size_t body = inner.bytes_written;
    if (!put_prefix(&outer, ITEMS_TAG, 1 + varint_size(body) + body) ||
        !put_prefix(&outer, kind, body))
        return RESULT_LIMIT;
    memmove(data + outer.bytes_written, data + PREFIX_MAX, body);
    memcpy(data, prefix, outer.bytes_written);
    *out_used = outer.bytes_written + body;
    return RESULT_OK;
}

enum result live_encode(const arthron_Live *item, uint8_t *data, size_t size, size_t *out_used) {
    pb_field_iter_t field;
    if (!pb_field_iter_begin_const(&field, arthron_Live_fields, item) ||
        !pb_field_iter_find(&field, item->which_message))
        return RESULT_INVALID;
    return encode_live(field.tag, field.submsg_desc, field.pData, data, size, out_used);
}

enum result live_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used) {
    return encode_live(LIVE_CHUNK_TAG, arthron_MeshChunk_fields, chunk, data, size, out_used);
}
