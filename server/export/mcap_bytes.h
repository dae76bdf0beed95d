// Bytes that grow: fields, texts and records as MCAP has them.
#pragma once

#include <stddef.h>
#include <stdint.h>

struct mcap_bytes {
    uint8_t *data;
    size_t size, room;
};

void mcap_bytes_fini(struct mcap_bytes *bytes);

void mcap_put(struct mcap_bytes *bytes, const void *data, size_t size);
void mcap_put_number(struct mcap_bytes *bytes, uint64_t value, int size); // little-endian
void mcap_put_text(struct mcap_bytes *bytes, const char *text);           // u32 length, bytes
// What is put between the two calls has its length before it, in `size` bytes.
size_t mcap_begin_sized(struct mcap_bytes *bytes, int size);
void mcap_end_sized(struct mcap_bytes *bytes, size_t begun, int size);
// The same for a record.
size_t mcap_begin_record(struct mcap_bytes *bytes, uint8_t opcode);
void mcap_end_record(struct mcap_bytes *bytes, size_t begun);
