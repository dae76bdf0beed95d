// The surfaces that loose bodies meet, and where one of them touches. For loose.c only.
#pragma once

#include "mesh/solid.h"
#include "step/output.h"

struct loose_ground {
    int count;
    struct loose_surface {
        int group;
        enum body body;
        struct mesh mesh; // S'
        struct solid solid;
    } surfaces[CASE_GROUPS_MAX];
    pose first[CASE_LOOSE_MAX]; // T_body_loose: where each lies at first
};

// Earlier answers of each surface: the triangle from which the next search starts, and the signed
// distance at a point of the surface's body. From there it changes by no more than the way.
struct loose_hints {
    uint32_t triangle[CASE_GROUPS_MAX]; // MESH_NONE
    double distance[CASE_GROUPS_MAX];   // NAN
    vec3 at[CASE_GROUPS_MAX];
};

void loose_hints_init(struct loose_hints *hints); // no answers

// One ellipsoid beside one surface, by the plane of the surface's closest point.
struct loose_contact {
    int surface; // -1: none
    double gap;  // negative where it is inside
    vec3 normal; // unit, away from the surface; in the frame of T_frame_body
};

// The half width of an ellipsoid along a unit vector.
double loose_reach(vec3 radii_mm, quat rotation, vec3 direction);

// Beside one surface. Farther than LOOSE_FAR_MM, or where earlier answers say that the gap is above
// `wanted_mm`: gap INFINITY.
#define LOOSE_FAR_MM 80.0
struct loose_contact loose_contact_with(const struct loose_ground *ground, int surface,
                                        const pose T_frame_body[BODY_COUNT], vec3 radii_mm, pose T,
                                        double wanted_mm, struct loose_hints *hints);

// The nearest of all but those of groups that were cut.
struct loose_contact loose_nearest(const struct loose_ground *ground, uint32_t cut,
                                   const pose T_frame_body[BODY_COUNT], vec3 radii_mm, pose T,
                                   struct loose_hints *hints);

// The shortest turn that takes the ellipsoid's last axis to the normal, or to its opposite.
quat loose_laid(quat rotation, vec3 normal);
