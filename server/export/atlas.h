// Where the triangles of any mesh lie in an image: a parametrisation that needs no seams and no
// luck.
//
// Triangle t has the cell of 2 × 2 texels at (2 (t mod n), 2 (t div n)), n = ceil(sqrt(count)): its
// corner 0 at the cell's (0, 0), corner 1 at (1, 0), corner 2 at (0, 1). The texel (1, 1) has what
// the others' plane has there, v1 + v2 − v0, so that bilinear filtering between the centres of
// texels gives the triangle's own linear interpolation, and nothing of a neighbour's.
#pragma once

#include <stdint.h>

struct atlas {
    uint32_t cells; // in a row, n
    uint32_t triangles;
    uint32_t width, height; // texels
};

struct atlas atlas_of(uint32_t triangle_count); // at least 1

#define ATLAS_FOURTH 3 // no corner

// Whose texel it is: the triangle, or UINT32_MAX for none, and its corner or ATLAS_FOURTH.
uint32_t atlas_triangle(const struct atlas *atlas, uint32_t x, uint32_t y, int *out_corner);

// Of a triangle's corner 0..2, glTF's TEXCOORD: the centre of its texel, v downwards.
void atlas_uv(const struct atlas *atlas, uint32_t triangle, int corner, float out_uv[2]);
