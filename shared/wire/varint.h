// Numbers as in protobuf, for the bytes of a mesh's payload. Private to this room.
#pragma once

#include "base/bytes.h"

static inline void write_varint(struct writer *w, uint32_t value) {
    for (; value >= 0x80; value >>= 7)
        write_u8(w, (uint8_t)(value | 0x80));
    write_u8(w, (uint8_t)value);
}

// A small number where the signed one is near 0.
static inline uint32_t zigzag(uint32_t value) {
    return value << 1 ^ (value >> 31 ? UINT32_MAX : 0);
}
