// Packed files, for those who ask for the same ones: whole classes open the same case. Bounded:
// what was asked for least lately makes room. From any threads.
#pragma once

#include <stddef.h>
#include <stdint.h>

#define GZIP_CACHE_NAME_MAX 704
#define GZIP_CACHE_BYTES (64 << 20)

struct gzip_cache;

struct gzip_cache *gzip_cache_create(size_t most);  // bytes in all
void gzip_cache_destroy(struct gzip_cache **cache); // what was taken lives on

struct gzip_file {
    const uint8_t *bytes;
    size_t size;
};

// What is there of this name, or NULL; to be released.
const struct gzip_file *gzip_cache_take(struct gzip_cache *cache, const char *name);

// Keeps the bytes (of malloc, the cache's from now on) where there is room for them, in the place
// of what had the name; they are taken, too.
const struct gzip_file *gzip_cache_put(struct gzip_cache *cache, const char *name, uint8_t *bytes,
                                       size_t size);

void gzip_file_release(
    const struct gzip_file **packed); // NULL inside is fine; *packed becomes NULL
