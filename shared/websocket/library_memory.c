#include "websocket/library_memory.h"

#include "base/check.h"

#include <libwebsockets.h>
#include <openssl/crypto.h>
#include <stdlib.h>
#include <uv.h>

static void *crypto_malloc(size_t size, const char *file, int line) {
    (void)file;
    (void)line;
    return size ? alloc_resize(NULL, 1, size) : NULL;
}

static void crypto_free(void *memory, const char *file, int line) {
    (void)file;
    (void)line;
    free(memory);
}

static void *resize(void *memory, size_t size) {
    if (size)
        return alloc_resize(memory, 1, size);
    free(memory);
    return NULL;
}

static void *crypto_realloc(void *memory, size_t size, const char *file, int line) {
    (void)file;
    (void)line;
    return resize(memory, size);
}

static void *websockets_realloc(void *memory, size_t size, const char *reason) {
    (void)reason;
    return resize(memory, size);
}

static void *loop_malloc(size_t size) {
    return size ? alloc_resize(NULL, 1, size) : NULL;
}

static void *loop_calloc(size_t count, size_t size) {
    return count && size ? alloc(count, size) : NULL;
}

void libraries_use_our_memory(void) {
    CHECK(CRYPTO_set_mem_functions(crypto_malloc, crypto_realloc, crypto_free) == 1);
    CHECK(uv_replace_allocator(loop_malloc, resize, loop_calloc, free) == 0);
    lws_set_allocator(websockets_realloc);
}
