// A stream of bytes from one thread, the appender, to others, which release it. For writer.c and
// disk.c only.
//
// A position is a number of bytes since the first one. The memory is reserved as a whole and used
// in chunks, the lowest free one first, so that only as many pages are touched as were ever needed.
#pragma once

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BUFFER_CHUNK ((size_t)1 << 16)
#define BUFFER_CHUNKS 64
#define BUFFER_SIZE (BUFFER_CHUNKS * BUFFER_CHUNK) // about 40 s of one instrument at 100 Hz

struct buffer {
    uint8_t *memory;
    _Alignas(64) atomic_uint_fast64_t head; // position of the next byte; the appender writes it
    uint8_t places[BUFFER_CHUNKS];          // in memory, of the chunks that are in use
    _Alignas(64) atomic_uint_fast64_t free; // a bit for each place
    uint64_t kept;    // the first position that is not released; for the releasing thread
    uint64_t touched; // number of places
};

bool buffer_init(struct buffer *buffer); // false: no memory
void buffer_fini(struct buffer *buffer);

// For the appender. False if there is no room for all bytes; at most a chunk at once.
bool buffer_put(struct buffer *buffer, const uint8_t *data, size_t size);
bool buffer_has_room(const struct buffer *buffer, size_t size);

uint64_t buffer_head(const struct buffer *buffer);
// The contiguous bytes from a position on, at most up to the head. Returns their number.
size_t buffer_span(const struct buffer *buffer, uint64_t at, const uint8_t **out_data);
// The same into the caller's memory, and other bytes in the place of those. For the thread that
// reads them; they are there, and not released.
void buffer_read(const struct buffer *buffer, uint64_t at, uint8_t *out, size_t size);
void buffer_change(struct buffer *buffer, uint64_t at, const uint8_t *data, size_t size);
// Frees the bytes before the position.
void buffer_release(struct buffer *buffer, uint64_t before);
// Touches memory ahead, so that the appender never waits for a new page.
void buffer_touch_ahead(struct buffer *buffer);
