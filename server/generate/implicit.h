// Solids given by a function: negative inside, positive outside, 0 on the surface, about as steep
// as a distance. Their surfaces become closed triangle meshes.
#pragma once

#include "mesh/mesh.h"

#include <math.h>

typedef double (*implicit)(vec3 p);

// Union and intersection whose edge is rounded off over a width k (mm): where they are further
// apart than that, the lesser and the greater one.
static inline double smooth_min(double a, double b, double k) {
    double least = a < b ? a : b, apart = fabs(a - b);
    if (apart >= k)
        return least;
    double h = (k - apart) / k;
    return least - h * h * k / 4;
}

static inline double smooth_max(double a, double b, double k) {
    return -smooth_min(-a, -b, k);
}

vec3 implicit_gradient(implicit solid, vec3 p);

// The zero surface inside the box as a mesh with edges of about `edge` mm: a vertex for each grid
// cell that the surface passes through (surface nets), evened out, and put on the surface by
// Newton steps. Closed, manifold and oriented where the solid ends at least two edges before the
// box does; details finer than an edge may be lost. The caller releases *out_mesh with mesh_fini.
void implicit_mesh(implicit solid, struct box box, double edge, struct mesh *out_mesh);
