// Numbers in the contents of OpenIGTLink's messages.
#pragma once

#include "igtl/big_endian.h"

#include <string.h>

static inline uint32_t number_at(const uint8_t *bytes) {
    return (uint32_t)big_endian_get(bytes, 4);
}

static inline float float_at(const uint8_t *bytes) {
    uint32_t bits = number_at(bytes);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}
