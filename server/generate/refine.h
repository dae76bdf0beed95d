// Triangles small enough for a displacement to show in them.
//
// A scan has long triangles where it is flat. A displacement that bends within them is lost, and
// what lies on them with smaller triangles would move into them.
#pragma once

#include "case/case.h"

// A displacement of space, of what lies within a radius of its middle.
struct refine_map {
    vec3 (*displacement)(const void *context, vec3 p);
    const void *context;
    vec3 middle;
    double radius_mm;
};

// How far the displacement of an edge's middle may be from the mean of that of its ends.
#define REFINE_MM 0.02

// Halves edges of S + warp until they are as fine as REFINE_MM asks, and at most half of the radius
// long near the middle. The surface stays the same to the rounding of floats. New vertices have
// what is in the middle between their ends, of displacements, shares and wear too; a new one is
// covered where both are.
void refine_group(struct case_group *group, const struct refine_map *map);
