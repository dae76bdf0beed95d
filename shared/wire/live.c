#include "wire/live.h"

#include <pb_encode.h>

#define ITEMS_TAG 1 // of items in LiveBatch
#define CHUNK_TAG 5 // of mesh_chunk in Live

_Static_assert((int)arthron_Live_resection_tag == CHUNK_TAG - 1 &&
                   (int)arthron_Live_remark_tag == CHUNK_TAG + 1,
               "the chunk is where the schema has it");

static size_t varint_size(size_t value) {
    size_t size = 1;
    for (; value >= 128; value >>= 7)
        size++;
    return size;
}

static bool put_tag(pb_ostream_t *stream, uint32_t tag) {
    return pb_encode_tag(stream, PB_WT_STRING, tag);
}

enum result live_encode(const arthron_Live *item, uint8_t *data, size_t size, size_t *out_used) {
    pb_ostream_t stream = pb_ostream_from_buffer(data, size);
    if (!put_tag(&stream, ITEMS_TAG) || !pb_encode_submessage(&stream, arthron_Live_fields, item))
        return RESULT_LIMIT;
    *out_used = stream.bytes_written;
    return RESULT_OK;
}

enum result live_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used) {
    pb_ostream_t stream = pb_ostream_from_buffer(data, size);
    size_t inner;
    if (!pb_get_encoded_size(&inner, arthron_MeshChunk_fields, chunk))
        return RESULT_LIMIT;
    if (!put_tag(&stream, ITEMS_TAG) ||
        !pb_encode_varint(&stream, 1 + varint_size(inner) + inner) ||
        !put_tag(&stream, CHUNK_TAG) ||
        !pb_encode_submessage(&stream, arthron_MeshChunk_fields, chunk))
        return RESULT_LIMIT;
    *out_used = stream.bytes_written;
    return RESULT_OK;
}
