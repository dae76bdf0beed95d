// Encodes the items of a LiveBatch, the server's messages to pages, one by one. Encoded items one
// after another are a LiveBatch, so an item for many pages is encoded once.
#pragma once

#include "wire/wire.h"

#define LIVE_ITEM_MAX 65536 // one item; also a whole batch

// RESULT_LIMIT: the item and nine more bytes do not fit `size`. RESULT_INVALID: the item has no
// kind. Not for a mesh_chunk.
enum result live_encode(const arthron_Live *item, uint8_t *data, size_t size, size_t *out_used);
enum result live_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used);
