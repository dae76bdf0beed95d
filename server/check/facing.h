// Whether the displacements of surfaces that lie close to each other go together
// (compatibility). Where surface b faces surface a over a gap g, with the direction n from a to b:
//
//     g + n · (Δ_b − Δ_a) <= 0     the gap is filled, or more: no field can take both surfaces to
//                                  where they belong without folding
//     |Δ_b − Δ_a| > g              the field has to change by more than a hand moves across it
//
// Surfaces that touch or overlap have the gap 0 at any depth. Displacements that differ by less
// than FACING_SLACK_MM count as equal. Surfaces of a scan overlap by as much, so a map that moves
// all of them alike moves overlapping points a little differently. Millimetres, the scene's world.
#pragma once

#include "warp/warp.h"

#define FACING_GAP_MM 1.0
#define FACING_SLACK_MM 0.05

struct facing_spot {
    vec3 place; // on surface a
    double gap_mm;
    double closed_mm; // −n · (Δ_b − Δ_a): positive where they come closer
    double apart_mm;  // |Δ_b − Δ_a|
};

// Two surfaces, a < b. Counts are of vertices of either that the other one faces.
struct facing_pair {
    int a, b;
    uint64_t count;    // within FACING_GAP_MM
    uint64_t filled;   // by the first condition; `filling`: the largest of closed − gap
    uint64_t strained; // by the second; `strain`: the largest of apart − gap
    struct facing_spot filling, strain;
};

struct facing_figures {
    int count; // pairs that face each other anywhere
    struct facing_pair pairs[WARP_SURFACES_MAX * (WARP_SURFACES_MAX - 1) / 2];
};

// Surfaces face each other where their normals are within 60 degrees of opposite. skipped: bit k:
// leave surface k out. Threads inside; the figures depend on none of it.
void facing_compare(const struct warp_scene *scene, uint32_t skipped,
                    struct facing_figures *out_figures);

// The same for one point of a surface, given by barycentric weights in a triangle: the spots with
// the largest differences. False: no surface faces the point.
bool facing_at(const struct warp_scene *scene, uint32_t skipped, int surface, uint32_t triangle,
               const double weights[3], struct facing_spot *out_filling,
               struct facing_spot *out_strain);

static inline bool facing_is_filled(const struct facing_spot *spot) {
    return spot->closed_mm > FACING_SLACK_MM && spot->closed_mm >= spot->gap_mm;
}

static inline bool facing_is_strained(const struct facing_spot *spot) {
    return spot->apart_mm > FACING_SLACK_MM && spot->apart_mm > spot->gap_mm;
}
