// The mean displacement of a surface as a point of space sees it, near parts weighing most:
//
//     ũ(y) = ∫ u r⁻⁵ dA / ∫ r⁻⁵ dA,   r = |y − x|
//
// and the mean x̃ of the surface's points likewise. Smooth where the closest point jumps, and near
// the surface as good as equal to the displacement there. Found by a Barnes-Hut walk over a tree of
// moments, to about 1e-3 of the differences of u. Millimetres, in the mesh's frame.
#pragma once

#include "warp/surface_tree.h"

// The moments of one displacement of a mesh.
struct surface_mean;

// displacement: 3 * vertex_count, finite. Keeps pointers to both, which must outlive it.
struct surface_mean *surface_mean_create(const struct surface_tree *tree,
                                         const float *displacement);
void surface_mean_destroy(struct surface_mean **mean); // NULL inside is fine

// Call it when the displacements of these vertices have changed (a vertex may come twice). Any
// order and any number of calls give the same bits as a new mean. Computes only the moments around
// these vertices and above them; allocates nothing.
void surface_mean_update(struct surface_mean *mean, const uint32_t *vertices, uint32_t count);

struct surface_value {
    vec3 displacement; // ũ
    mat3 change;       // ∂ũ/∂y
    vec3 point;        // x̃
    mat3 slide;        // ∂x̃/∂y
};

#define SURFACE_MEAN_NEAREST_MM 1e-6

// distance: from p to the surface, at least SURFACE_MEAN_NEAREST_MM; errors are measured by it.
// False where the surface has no area or is too far away for double precision. Allocates nothing;
// any number of threads may ask at once.
bool surface_mean_at(const struct surface_mean *mean, vec3 p, double distance,
                     struct surface_value *out_value);
