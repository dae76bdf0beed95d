// The walk behind warp/surface_integral.h, for its files only.
#pragma once

#include "warp/surface_blocks.h"

// Integrals of r⁻⁴, of (x − p) r⁻⁴ and of u r⁻⁴, with their derivatives by p, lane by lane.
struct lane_sums {
    _Alignas(BLOCK_ALIGN) block_lanes weight;
    block_lanes weight_slope[3];
    block_lanes place[3], place_slope[9];
    block_lanes field[3], field_slope[9];
};

struct walk {
    const struct surface_blocks *blocks;
    const float *displacement;           // NULL for 0
    const struct block_moments *moments; // of each block; NULL for 0
    vec3 p, off;                         // off: from the closest point to p
    double square;                       // |off|²
    struct lane_sums sums;
};

// What a processor may have; each gives the same bits.
enum walk_level { WALK_PLAIN, WALK_AVX2, WALK_AVX512, WALK_LEVELS };

enum walk_level surface_walk_best(void); // that this one has

// sums being 0; level: at most the best.
void surface_walk(struct walk *walk, enum walk_level level);

// One for each level, by warp/surface_walk_lanes.h.
void surface_walk_plain(struct walk *walk);
void surface_walk_avx2(struct walk *walk);
void surface_walk_avx512(struct walk *walk);
