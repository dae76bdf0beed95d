// Integrals over a surface as a point p of space sees it, near parts weighing most:
//
//     M = ∫ r⁻⁴ dA     ũ = ∫ u r⁻⁴ dA / M     x̃ = ∫ x r⁻⁴ dA / M,   r = |p − x|
//
// Of a plane M is π/d². Smooth where the closest point jumps. Far pieces are taken by their
// moments, near triangles exactly; between the two the walk blends, so that what it gives is a
// smooth function of p, and the derivatives are that function's own. Lanes are summed in a fixed
// order: the same bits on every CPU. Millimetres, in the mesh's frame.
#pragma once

#include "warp/surface_blocks.h"

// The moments of one displacement of a mesh.
struct surface_integral;

// displacement: 3 * vertex_count, finite; NULL for 0. Keeps pointers to both, which must outlive
// it.
struct surface_integral *surface_integral_create(const struct surface_blocks *blocks,
                                                 const float *displacement);
void surface_integral_destroy(struct surface_integral **integral); // NULL inside is fine

// Call it when the displacements of these vertices have changed (a vertex may come twice). Any
// order and any number of calls give the same bits as a new integral. Computes only the moments
// around these vertices and above them; allocates nothing.
void surface_integral_update(struct surface_integral *integral, const uint32_t *vertices,
                             uint32_t count);

struct surface_sight {
    double weight;     // M, 1/mm²
    vec3 weight_slope; // ∂M/∂p
    vec3 displacement; // ũ
    mat3 change;       // ∂ũ/∂p
    vec3 point;        // x̃
    mat3 slide;        // ∂x̃/∂p
};

#define SURFACE_INTEGRAL_NEAREST_MM 1e-6

// closest: the surface's point closest to p; errors are measured by its distance. False where that
// is under SURFACE_INTEGRAL_NEAREST_MM or too far for double precision, and where the surface has
// no area. Allocates nothing; any number of threads may ask at once.
bool surface_integral_at(const struct surface_integral *integral, vec3 p, vec3 closest,
                         struct surface_sight *out_sight);
