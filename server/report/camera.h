// Where a picture is taken from. The camera's frame: x to the right in the picture, y up, z towards
// the viewer, the origin at what is looked at.
#pragma once

#include "mesh/mesh.h"

struct camera {
    pose T_world_camera;
    double height_mm;   // of what the picture shows at the origin
    double distance_mm; // of the eye from the origin, along z; INFINITY: parallel rays
};

struct ray {
    vec3 origin, direction; // direction: unit length
};

// The camera that sees all of the box in a picture of that shape (width over height), with a margin
// of 4 %. from: towards the viewer; up: not along it; heights: of the picture between the eye and
// the box's middle, above 1, INFINITY for parallel rays.
struct camera camera_fit(const struct box *box, vec3 from, vec3 up, double aspect, double heights);

// The ray through a place of the picture: x from -aspect/2 (left) to aspect/2, y from -1/2 (below)
// to 1/2. It starts at the eye; parallel ones at `reach_mm` before the origin.
struct ray camera_ray(const struct camera *camera, double x, double y, double reach_mm);
