// What the server says to pages: the items of a LiveBatch, one by one. Items behind one another are
// a LiveBatch, so what is the same for many pages is encoded once.
#pragma once

#include "wire/wire.h"

#define LIVE_ITEM_MAX 65536 // one item; also a whole batch

// RESULT_LIMIT where it and nine bytes more do not fit `size`, RESULT_INVALID where it is of no
// kind. Not for a mesh_chunk.
enum result live_encode(const arthron_Live *item, uint8_t *data, size_t size, size_t *out_used);
enum result live_encode_chunk(const arthron_MeshChunk *chunk, uint8_t *data, size_t size,
                              size_t *out_used);
