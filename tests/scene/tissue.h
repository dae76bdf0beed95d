// Tissue that can recede, for tests of match/match.h, and oracles of another make: every triangle
// and every vertex in turn.
#pragma once

#include "match/match.h"

struct tissue {
    struct mesh mesh;
    float *warp, *maxcut; // warp may be NULL
    struct match_surface *surface;
    struct match *match;
    double *before; // blends at the last tissue_remember, 0 until then
};

// A displaced sphere of radius 10 around the origin with 8 n² triangles; its upper half recedes
// towards the middle, by `most_mm` at the top (vertex 0).
void tissue_sphere(struct tissue *out, int n, double most_mm);

// A sphere that recedes by 2 mm where x < 0 and swells by up to 5 mm elsewhere.
void tissue_uneven(struct tissue *out, int n, uint64_t seed);

// A displaced meniscus of 2360 mm³ whose inner margin recedes, most in the body.
void tissue_meniscus(struct tissue *out);

void tissue_fini(struct tissue *tissue);

vec3 tissue_place(const struct tissue *tissue, uint32_t vertex, double blend); // S''
double tissue_way(const struct tissue *tissue, uint32_t vertex);               // its length
void tissue_remember(struct tissue *tissue);

double tissue_volume(const struct tissue *tissue, const double *blends);

// b_i of match.h for the blends remembered; 0 where a vertex cannot move. The caller frees it.
double *tissue_falloffs(const struct tissue *tissue, const struct brush *brushes, int count,
                        double widening);
// With the blends remembered raised by s.
double tissue_volume_at(const struct tissue *tissue, const double *falloffs, double s);
