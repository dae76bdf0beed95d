// The surfaces of a case, placed and ready to be warped.
#pragma once

#include "case/case.h"
#include "warp/warp.h"

// Must not move in memory.
struct anatomy {
    struct knee_case *knee;
    struct query *queries[CASE_GROUPS_MAX];
    struct surface_tree *trees[CASE_GROUPS_MAX];
    struct surface_mean *means[CASE_GROUPS_MAX];
    struct surface_blocks *blocks[CASE_GROUPS_MAX];
    struct surface_integral *integrals[CASE_GROUPS_MAX];
    struct warp_surface surfaces[CASE_GROUPS_MAX], solids[CASE_GROUPS_MAX];
    pose T_world_body[BODY_COUNT];
    struct warp_scene scene, solid; // solid: without what is hollow, for the integral field
    uint32_t hollow;                // bit k: one is inside group k, the skin
};

// Takes the case (NULL after) where it succeeds. In the rest pose.
enum result anatomy_init(struct anatomy *out_anatomy, struct knee_case **knee, struct error *err);
void anatomy_fini(struct anatomy *anatomy); // zeroed is fine

// To be called when displacements of the case have changed.
void anatomy_displace(struct anatomy *anatomy);
void anatomy_flex(struct anatomy *anatomy, double flexion_deg);

// Of a corner of a triangle.
vec3 anatomy_delta(const struct warp_scene *scene, int surface, uint32_t triangle, int corner);

// The longest Δ of all vertices, mm, and the box of those with more than 1e-3 mm, in the world.
double anatomy_largest(const struct warp_scene *scene, struct box *out_box);

#define ANATOMY_CLEAR_MM 0.5

// Where the tip of an instrument may be: the nearest surface shows its front, and no second one is
// within ANATOMY_CLEAR_MM. hollow: as above.
bool anatomy_reaches(const struct warp_scene *scene, uint32_t hollow, vec3 y);

// From y to the nearest solid within 15 mm, negative inside it; INFINITY where there is none.
// Instruments pass through what is hollow.
double anatomy_gap(const struct warp_scene *scene, uint32_t hollow, vec3 y);

// Inside the hull of all groups, grown by 10 mm (the hull: between a hundred pairs of planes).
#define HULL_PLANES 200
#define HULL_BEYOND_MM 10.0

struct hull {
    vec3 normals[HULL_PLANES];
    double heights[HULL_PLANES];
};

void anatomy_hull(const struct warp_scene *scene, struct hull *out_hull);
bool hull_holds(const void *hull, vec3 p); // for struct harmonic_setup
