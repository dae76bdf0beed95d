// Compressed files, because whole classes open the same case. The cache is bounded, and drops the
// least recently used file. Any thread may call.
#pragma once

#include <stddef.h>
#include <stdint.h>

#define GZIP_CACHE_NAME_MAX 704
#define GZIP_CACHE_BYTES (64 << 20)

struct gzip_cache;

struct gzip_cache *gzip_cache_create(size_t most);  // most: bytes in all
void gzip_cache_destroy(struct gzip_cache **cache); // files that were taken live on

struct gzip_file {
    const uint8_t *bytes;
    size_t size;
};

// The file of this name, or NULL. The caller releases it.
const struct gzip_file *gzip_cache_take(struct gzip_cache *cache, const char *name);

// Stores the bytes (of malloc; the cache owns them now) in the place of the file of that name, if
// they fit, and returns them, for the caller to release.
const struct gzip_file *gzip_cache_put(struct gzip_cache *cache, const char *name, uint8_t *bytes,
                                       size_t size);

void gzip_file_release(
    const struct gzip_file **packed); // NULL inside is fine; *packed becomes NULL
