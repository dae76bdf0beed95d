// Volume matching: how far the warped physical surface has receded, so that it encloses the same
// volume as the cut mesh (Spillmann, Tuchschmid, Harders, 4.4 and 4.5, Eq. 8, Algorithm 1).
//
//     S''_i = S'_i + s_i (S'_max,i − S'_i),   s_i in [0, 1],   S' = S + warp, S'_max = S' + maxcut
//
// A match raises s_i around the new surface of a cut: s_i ← clamp(s_i + s b_i, 0, 1), s in [0, 1],
// b the brushes' falloff, until the volume inside S'' is the wanted one. That volume is a piecewise
// cubic polynomial in s, with a breakpoint wherever a vertex reaches its bound: its coefficients
// are summed once, over the touched triangles. It need not fall all the way, where S'_max is not
// inside S': the smallest s is taken. Brushes that cannot give the whole volume widen. Matching
// always ends: reached, or saturated with a rest. Millimetres. A call allocates nothing, and the
// same calls give the same bits.
#pragma once

#include "mesh/mesh.h"

// The part that all sessions of a case share. Immutable.
struct match_surface;

// mesh: closed, oriented, facing outwards. warp, maxcut: 3 * vertex_count; warp may be NULL for 0.
// All are copied.
struct match_surface *match_surface_create(const struct mesh *mesh, const float *warp,
                                           const float *maxcut);
void match_surface_destroy(struct match_surface **surface);       // NULL inside is fine
double match_surface_volume(const struct match_surface *surface); // inside S'
vec3 match_surface_vertex(const struct match_surface *surface, uint32_t vertex); // S'
double match_surface_least(const struct match_surface *surface);                 // inside S'_max

// The blends of one session. The surface must outlive it.
struct match;

struct match *match_create(const struct match_surface *surface);
struct match *match_copy(const struct match *match); // of the same surface, equal to the bit
void match_destroy(struct match **match);
const double *match_blends(const struct match *match);         // s, one for each vertex
double match_volume(const struct match *match);                // inside S'', summed anew
vec3 match_vertex(const struct match *match, uint32_t vertex); // S''

// Where a match raises s_i, and how strongly:
//
//     b_i = 2 (exp(−2 d²/h²) − exp(−2)) / (1 − exp(−2)),   0 for d >= h
//
// a Gaussian (σ = h/2) that ends with the extent of the cut, and at s = 1 takes its inner half to
// S'_max. d is the distance of x_cut from the way that the vertex still has to go, from S'' to
// S'_max: a cut removes tissue that lies on the paths of the vertices that have to recede, while S'
// may be far away after earlier cuts. Where brushes overlap, the highest b counts.
struct brush {
    vec3 centre;   // x_cut: in the frame of the mesh, on the surface as the trainee sees it
    double radius; // h, the extent of the new surface; no less than a mean edge is used
};

enum match_outcome {
    MATCH_REACHED,
    MATCH_SATURATED // even the widest brushes cannot give the whole volume; left_mm3 has the rest
};

struct match_report {
    enum match_outcome outcome;
    double volume_mm3; // inside S'' after it
    double left_mm3;   // volume_mm3 − target: still to be given
    double scale;      // s
    double widening;   // factor on the radii
    int steps;         // Newton steps and bisections, all widenings together
    uint32_t changed_count;
    const uint32_t *changed; // vertices whose s changed, ascending; valid until the next call
};

#define MATCH_WIDENING_MAX 4.0

// Brings the volume inside S'' to target_mm3. A target above the present volume changes nothing and
// leaves a negative rest; without a brush nothing can be given.
void match_to_volume(struct match *match, const struct brush *brushes, int brush_count,
                     double target_mm3, struct match_report *out_report);
