// The harmonic displacement, which a warp is held against: of all fields that take the points of
// each surface to where they are to go, and are 0 on the far boundary, the one with the least
// ∫|∇W|² over the space between, ∇²W = 0. Solved on a grid, too slow for a session.
//
// Seven points; where a grid edge meets a surface, at the share θ of the edge, the surface's own
// value stands there: Σ (W_p − W_q) + Σ (W_p − g)/θ = 0 over the free edges and the cut ones of p
// (Gibou, Fedkiw, Cheng, Kang, J. Comput. Phys. 176, 2002: symmetric, of second order). Conjugate
// gradients with an incomplete Cholesky factor. Millimetres, in the world.
#pragma once

#include "warp/warp.h"

#define HARMONIC_NONE UINT32_MAX

struct harmonic;

struct harmonic_setup {
    const struct warp_scene *scene;
    uint32_t hollow;   // bit k: the space lies inside surface k, not outside
    struct box box;    // beyond it W is that of `around`, 0 where that is NULL
    double spacing_mm; // nodes lie on multiples of it, all shifted alike: those of 1 mm are among
                       // those of 0.5 mm
    bool (*is_within)(const void *context, vec3 p); // W = 0 where it is false; NULL: nowhere
    const void *context;
    // Of a larger box with the same surfaces, on a coarser grid. Where its space has no node next
    // to the border of this box, nothing flows through that.
    const struct harmonic *around;
};

// Zeroed: none. Of the nodes that are connected, without crossing a surface, to a region that sees
// mostly fronts of surfaces and is not less than a tenth of the largest one.
struct harmonic {
    int size[3]; // of the grid
    vec3 origin;
    double spacing_mm;
    uint32_t *index;           // of each node among those of the space, or HARMONIC_NONE
    uint32_t count;            // nodes of the space
    uint32_t *nodes;           // of each: i + size[0] * (j + size[1] * k)
    uint32_t (*neighbours)[6]; // −x, x, −y, y, −z, z; HARMONIC_NONE past a surface or the boundary
    vec3 *values;              // W
    int steps;                 // of the solver
    double residual;           // largest, over the largest value on a boundary
};

void harmonic_solve(const struct harmonic_setup *setup, struct harmonic *out_harmonic);
void harmonic_fini(struct harmonic *harmonic);

vec3 harmonic_place(const struct harmonic *harmonic, uint32_t i);

// The same node of another grid, HARMONIC_NONE where it is not in that one's space.
uint32_t harmonic_find(const struct harmonic *harmonic, vec3 place);

// W by the nodes of the space among the eight around the place; false where there is none.
bool harmonic_at(const struct harmonic *harmonic, vec3 place, vec3 *out_value);

// ∂W/∂y by the next nodes along x, y and z; false where one of them is not there.
bool harmonic_gradient(const struct harmonic *harmonic, uint32_t i, mat3 *out_gradient);
