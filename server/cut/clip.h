// Clips a triangle to a blade. Each edge of the clipped polygon is labelled with its plane or side.
#pragma once

#include "mesh/convex.h"

#define CLIP_SIDE CONVEX_PLANES_MAX // label of a triangle's side i: CLIP_SIDE + i
#define CLIP_MAX (CONVEX_PLANES_MAX + 3)

// Edge i runs from points[i] to the next point and lies on labels[i]. Counter-clockwise as the
// triangle is.
struct clip {
    int count;
    vec3 points[CLIP_MAX];
    int labels[CLIP_MAX];
};

// values[i]: signed distances of corner i from the planes. planes: bits of those to clip with.
void clip_triangle(const struct convex *blade, const vec3 corners[3], const double *const values[3],
                   uint64_t planes, struct clip *out_clip);
