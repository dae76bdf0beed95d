// Points in an order in which each eight, and each eight of eights, lie close together.
#pragma once

#include <stdint.h>

#define EIGHT 8

// Of so many.
static inline uint32_t eights_count(uint32_t count) {
    return count / EIGHT + (count % EIGHT > 0);
}

struct eights_item {
    float at; // scratch
    uint32_t number;
};

// middles: 3 for each of count points, finite. Fills out_items; only its last eight may be short.
void eights_order(const float *middles, uint32_t count, struct eights_item *out_items);
