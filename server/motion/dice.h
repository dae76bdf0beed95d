// Numbers that look random, the same for one seed (splitmix64).
#pragma once

#include <stdint.h>

static inline uint64_t dice_bits(uint64_t *state) {
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static inline double dice_share(uint64_t *state) { // 0 to 1
    return (double)(dice_bits(state) >> 11) * 0x1p-53;
}
