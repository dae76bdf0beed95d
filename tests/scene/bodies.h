// Several surfaces with displacements and queries, ready to be warped.
#pragma once

#include "scene/shapes.h"
#include "warp/warp.h"

#define BODIES_MAX 8

// Must not move in memory: surfaces point at meshes. Zeroed: none.
struct bodies {
    int count;
    struct mesh meshes[BODIES_MAX];
    float *displacements[BODIES_MAX];
    struct query *queries[BODIES_MAX];
    struct warp_surface surfaces[BODIES_MAX];
    struct surface_tree *trees[BODIES_MAX];
    struct surface_mean *means[BODIES_MAX];
    struct surface_blocks *blocks[BODIES_MAX];
    struct surface_integral *integrals[BODIES_MAX];
};

// Takes the mesh (zeroed after) and the displacement (NULL for none). `body`: its pose's index.
void bodies_add(struct bodies *bodies, struct mesh *mesh, float *displacement, int body);
void bodies_fini(struct bodies *bodies);

// Gives each displaced surface its mean.
void bodies_smooth(struct bodies *bodies);

// Gives every surface its integral.
void bodies_integrate(struct bodies *bodies);

// Two parallel walls at z = ±gap/2 facing each other, the lower one displaced by `rise` along z.
void bodies_walls(struct bodies *out, double gap_mm, double rise_mm);

// Arranged like a knee in extension, z proximal, the tibia's plateau near z = 0: femur, tibia, two
// menisci, patella, each of about 8 n² triangles, displaced by up to 3 mm; bodies 0, 1, 1, 1, 2.
void bodies_knee(struct bodies *out, int n);

// A tip that wanders between femur, tibia and menisci and now and then into them; t counts
// millimetres along its way, roughly.
vec3 bodies_knee_path(double t);
