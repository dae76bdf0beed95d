#include "web/gzip.h"

#include "base/check.h"

#include <stdlib.h>
#include <zlib.h>

#define GZIP_WINDOW (15 + 16) // zlib's way to ask for gzip's own header
#define MEMORY_LEVEL 8
#define FAST_LEVEL 4

uint8_t *gzip_pack(const uint8_t *bytes, size_t size, size_t *out_size) {
    z_stream stream = {0};
    NEED(deflateInit2(&stream, FAST_LEVEL, Z_DEFLATED, GZIP_WINDOW, MEMORY_LEVEL,
                      Z_DEFAULT_STRATEGY) == Z_OK,
         "memory");
    size_t bound = deflateBound(&stream, size);
    uint8_t *out = alloc(bound, 1);
    stream.next_in = (uint8_t *)(uintptr_t)bytes;
    stream.avail_in = (uInt)size;
    stream.next_out = out;
    stream.avail_out = (uInt)bound;
    CHECK(deflate(&stream, Z_FINISH) == Z_STREAM_END); // the bound is one
    *out_size = stream.total_out;
    deflateEnd(&stream);
    return out;
}

uint8_t *gzip_unpack(const uint8_t *packed, size_t packed_size, size_t size) {
    z_stream stream = {0};
    NEED(inflateInit2(&stream, GZIP_WINDOW) == Z_OK, "memory");
    uint8_t *out = alloc(size, 1);
    stream.next_in = (uint8_t *)(uintptr_t)packed;
    stream.avail_in = (uInt)packed_size;
    stream.next_out = out;
    stream.avail_out = (uInt)size;
    int end = inflate(&stream, Z_FINISH);
    size_t unpacked = stream.total_out;
    inflateEnd(&stream);
    if (end == Z_STREAM_END && unpacked == size)
        return out;
    free(out);
    return NULL;
}
