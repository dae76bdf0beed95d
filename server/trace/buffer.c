#include "trace/buffer.h"

#include "base/check.h"

#include <string.h>
#include <sys/mman.h>

#define AHEAD 2 // chunks

bool buffer_init(struct buffer *b) {
    memset(b, 0, sizeof *b);
    b->memory = mmap(NULL, BUFFER_SIZE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (b->memory == MAP_FAILED) {
        b->memory = NULL;
        return false;
    }
    atomic_store(&b->free, UINT64_MAX);
    buffer_touch_ahead(b);
    return true;
}

void buffer_fini(struct buffer *b) {
    if (b->memory)
        munmap(b->memory, BUFFER_SIZE);
}

// Chunks that so many bytes more would begin.
static int chunks_begun(uint64_t head, size_t size) {
    uint64_t begun = (head + BUFFER_CHUNK - 1) / BUFFER_CHUNK;
    return (int)((head + size + BUFFER_CHUNK - 1) / BUFFER_CHUNK - begun);
}

bool buffer_has_room(const struct buffer *b, size_t size) {
    int begun = chunks_begun(atomic_load_explicit(&b->head, memory_order_relaxed), size);
    uint64_t free = atomic_load_explicit(&b->free, memory_order_acquire);
    return __builtin_popcountll(free) >= begun;
}

static uint8_t *place_of(const struct buffer *b, uint64_t at) {
    return b->memory + b->places[at / BUFFER_CHUNK % BUFFER_CHUNKS] * BUFFER_CHUNK +
           at % BUFFER_CHUNK;
}

static void take_chunk(struct buffer *b, uint64_t at) {
    uint64_t free = atomic_load_explicit(&b->free, memory_order_acquire);
    int place = __builtin_ctzll(free);
    atomic_fetch_and_explicit(&b->free, ~((uint64_t)1 << place), memory_order_acquire);
    b->places[at / BUFFER_CHUNK % BUFFER_CHUNKS] = (uint8_t)place;
}

bool buffer_put(struct buffer *b, const uint8_t *data, size_t size) {
    CHECK(size <= BUFFER_CHUNK);
    uint64_t head = atomic_load_explicit(&b->head, memory_order_relaxed), end = head + size;
    if (!buffer_has_room(b, size))
        return false;
    while (head < end) {
        if (head % BUFFER_CHUNK == 0)
            take_chunk(b, head);
        size_t left = (size_t)(end - head), edge = BUFFER_CHUNK - head % BUFFER_CHUNK;
        size_t part = left < edge ? left : edge;
        memcpy(place_of(b, head), data, part);
        data += part;
        head += part;
    }
    atomic_store_explicit(&b->head, head, memory_order_release);
    return true;
}

uint64_t buffer_head(const struct buffer *b) {
    return atomic_load_explicit(&b->head, memory_order_acquire);
}

size_t buffer_span(const struct buffer *b, uint64_t at, const uint8_t **out_data) {
    uint64_t left = buffer_head(b) - at, edge = BUFFER_CHUNK - at % BUFFER_CHUNK;
    *out_data = place_of(b, at);
    return (size_t)(left < edge ? left : edge);
}

void buffer_read(const struct buffer *b, uint64_t at, uint8_t *out, size_t size) {
    for (const uint8_t *data; size;) {
        size_t span = buffer_span(b, at, &data), part = span < size ? span : size;
        memcpy(out, data, part);
        out += part;
        at += part;
        size -= part;
    }
}

void buffer_change(struct buffer *b, uint64_t at, const uint8_t *data, size_t size) {
    for (const uint8_t *place; size;) {
        size_t span = buffer_span(b, at, &place), part = span < size ? span : size;
        memcpy(place_of(b, at), data, part);
        data += part;
        at += part;
        size -= part;
    }
}

void buffer_release(struct buffer *b, uint64_t before) {
    for (; b->kept + BUFFER_CHUNK <= before; b->kept += BUFFER_CHUNK) {
        int place = b->places[b->kept / BUFFER_CHUNK % BUFFER_CHUNKS];
        atomic_fetch_or_explicit(&b->free, (uint64_t)1 << place, memory_order_release);
    }
}

void buffer_touch_ahead(struct buffer *b) {
    uint64_t free = atomic_load_explicit(&b->free, memory_order_acquire);
    for (int i = 0; i < AHEAD && free; i++, free &= free - 1) {
        int place = __builtin_ctzll(free);
        if (!(b->touched >> place & 1)) // its content is the appender's by now, perhaps
            madvise(b->memory + place * BUFFER_CHUNK, BUFFER_CHUNK, MADV_POPULATE_WRITE);
        b->touched |= (uint64_t)1 << place;
    }
}
