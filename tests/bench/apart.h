// How far the touched surface S'' and the cut mesh T are from one another.
#pragma once

#include "mesh/mesh.h"
#include "samples.h"

// Distances to `to` of points that lie evenly over the triangles of `from` that are `fresh`, films
// left out: places of it thinner than 0.15 mm.
// RESULT_IO where Embree cannot build.
enum result apart_distances(const struct mesh *from, const bool *fresh, const struct mesh *to,
                            struct samples *out, struct error *err);
