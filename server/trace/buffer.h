// A stream of bytes between one thread that appends and others that take it off. For writer.c and
// disk.c only.
//
// Positions count all bytes that were ever put. The memory is reserved as a whole and used in
// chunks, the lowest free one first, so that it is touched only as far as it was ever needed.
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
    _Alignas(64) atomic_uint_fast64_t head; // the next to put, the appender's
    uint8_t places[BUFFER_CHUNKS];          // in memory, of the chunks that are in use
    _Alignas(64) atomic_uint_fast64_t free; // a bit for each place
    uint64_t kept;                          // before it all is free: of who releases
    uint64_t touched;                       // places
};

void buffer_init(struct buffer *buffer);
void buffer_fini(struct buffer *buffer);

// The appender's. False, and nothing was put, where there is no room; at most a chunk at once.
bool buffer_put(struct buffer *buffer, const uint8_t *data, size_t size);
bool buffer_has_room(const struct buffer *buffer, size_t size);

uint64_t buffer_head(const struct buffer *buffer);
// What lies from a position on in one piece, up to the head.
size_t buffer_span(const struct buffer *buffer, uint64_t at, const uint8_t **out_data);
// Nobody looks again at what is before the position.
void buffer_release(struct buffer *buffer, uint64_t before);
// The appender is not to meet a page for the first time.
void buffer_touch_ahead(struct buffer *buffer);
