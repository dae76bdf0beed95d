// Numbers as OpenIGTLink has them.
#pragma once

#include <stdint.h>

// The value's lowest `size` bytes. Returns what is behind them.
static inline uint8_t *big_endian_put(uint8_t *out, uint64_t value, int size) {
    for (int i = 0; i < size; i++)
        out[i] = (uint8_t)(value >> 8 * (size - 1 - i));
    return out + size;
}

static inline uint64_t big_endian_get(const uint8_t *bytes, int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; i++)
        value = value << 8 | bytes[i];
    return value;
}
