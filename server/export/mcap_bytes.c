#include "export/mcap_bytes.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

void mcap_bytes_fini(struct mcap_bytes *bytes) {
    free(bytes->data);
    *bytes = (struct mcap_bytes){0};
}

void mcap_put(struct mcap_bytes *bytes, const void *data, size_t size) {
    if (bytes->size + size > bytes->room) {
        bytes->room = 2 * (bytes->size + size);
        bytes->data = alloc_resize(bytes->data, bytes->room, 1);
    }
    if (size)
        memcpy(bytes->data + bytes->size, data, size);
    bytes->size += size;
}

static void encode_number(uint8_t *out, uint64_t value, int size) {
    for (int i = 0; i < size; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

void mcap_put_number(struct mcap_bytes *bytes, uint64_t value, int size) {
    uint8_t encoded[8];
    encode_number(encoded, value, size);
    mcap_put(bytes, encoded, (size_t)size);
}

void mcap_put_text(struct mcap_bytes *bytes, const char *text) {
    mcap_put_number(bytes, strlen(text), 4);
    mcap_put(bytes, text, strlen(text));
}

size_t mcap_begin_sized(struct mcap_bytes *bytes, int size) {
    mcap_put_number(bytes, 0, size);
    return bytes->size;
}

void mcap_end_sized(struct mcap_bytes *bytes, size_t begun, int size) {
    encode_number(bytes->data + begun - (size_t)size, bytes->size - begun, size);
}

size_t mcap_begin_record(struct mcap_bytes *bytes, uint8_t opcode) {
    mcap_put_number(bytes, opcode, 1);
    return mcap_begin_sized(bytes, 8);
}

void mcap_end_record(struct mcap_bytes *bytes, size_t begun) {
    mcap_end_sized(bytes, begun, 8);
}
