// The inside of a quality plan, for this room only.
#pragma once

#include "quality/contour.h"
#include "quality/lattice.h"
#include "quality/quality.h"
#include "quality/zones.h"

#define ZONE_COUNT (ZONE_ALONG_COUNT * ZONE_ACROSS_COUNT)

enum sample_flag {
    SAMPLE_TISSUE = 1,
    SAMPLE_KEPT = 2, // inside S'_max
    SAMPLE_PLANNED = 4,
    SAMPLE_DAMAGED = 8
};

struct quality_plan {
    struct zones zones;
    struct lattice lattice;
    struct contour contour;
    uint8_t *samples; // flags
    uint8_t *zone_of; // a column's zone: ZONE_ACROSS_COUNT * along + across
    uint16_t *tissue; // how many samples of each column are tissue
    uint32_t whole[ZONE_COUNT], budget[ZONE_COUNT], planned, damaged; // samples
};
