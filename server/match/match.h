// Volume matching: how far a physical surface, warped, has given way so that it encloses what the
// cut mesh still encloses (Spillmann, Tuchschmid, Harders, 4.4 and 4.5, Eq. 8, Algorithm 1).
//
//     S''_i = S'_i + s_i (S'_max,i − S'_i),   s_i in [0, 1],   S' = S + warp, S'_max = S' + maxcut
//
// A match raises s_i around the new surface of a cut: s_i ← clamp(s_i + s b_i, 0, 1), b the
// brushes' falloff, until the volume inside S'' is the wanted one. That volume is a piecewise cubic
// polynomial in s, with a breakpoint wherever a vertex reaches its bound: its coefficients are
// summed once, over the touched triangles. Always ends: matched, or saturated with a rest.
// Millimetres.
#pragma once

#include "mesh/mesh.h"

// What all sessions of a case share. Immutable.
struct match_surface;

// warp, maxcut: 3 * vertex_count, copied; warp may be NULL for 0.
struct match_surface *match_surface_create(const struct mesh *mesh, const float *warp,
                                           const float *maxcut);
void match_surface_destroy(struct match_surface **surface);       // NULL inside is fine
double match_surface_volume(const struct match_surface *surface); // inside S'
double match_surface_least(const struct match_surface *surface);  // inside S'_max

// The blends of one session. The surface must outlive it.
struct match;

struct match *match_create(const struct match_surface *surface);
void match_destroy(struct match **match);
const double *match_blends(const struct match *match);         // s, one for each vertex
double match_volume(const struct match *match);                // inside S'', summed anew
vec3 match_vertex(const struct match *match, uint32_t vertex); // S''

struct brush {
    vec3 centre;   // x_cut: in the frame of the mesh, on the surface as the trainee sees it
    double radius; // h, the extent of the new surface
};

enum match_outcome {
    MATCH_REACHED,
    MATCH_SATURATED // the brushes, as wide as they may get, cannot give all: the rest is in
                    // left_mm3
};

struct match_report {
    enum match_outcome outcome;
    double volume_mm3; // inside S'' after it
    double left_mm3;   // volume_mm3 − target: what is still to be given
    double scale;      // s
    double widening;   // factor on the radii
    int steps;         // Newton steps and bisections, all widenings together
    uint32_t changed_count;
    const uint32_t *changed; // vertices whose s changed, ascending; valid until the next call
};

#define MATCH_WIDENING_MAX 4.0

// Brings the volume inside S'' to target_mm3. A target above the present volume changes nothing and
// leaves a negative rest.
void match_to_volume(struct match *match, const struct brush *brushes, int brush_count,
                     double target_mm3, struct match_report *out_report);

// Algorithm 1 of the paper, bounded: for comparison. tolerance_mm3: its ε.
void match_by_bisection(struct match *match, const struct brush *brushes, int brush_count,
                        double target_mm3, double tolerance_mm3, struct match_report *out_report);
