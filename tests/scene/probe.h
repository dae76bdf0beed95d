// A straight probe in the knee of scene/bodies.h, brought into touch through a portal.
#pragma once

#include "random.h"
#include "scene/bodies.h"

enum probe_touch {
    PROBE_TIP,   // the tip on a surface
    PROBE_SHAFT, // the shaft on one
    PROBE_BOTH,  // the shaft on one and the tip on another
    PROBE_TOUCHES
};

#define PROBE_LENGTH_MM 60.0 // of shaft that may touch

struct probe {
    vec3 portal;
    pose T_world_tip; // z along the shaft, away from the handle
};

// Along `direction` through the portal, the tip so deep behind it.
pose probe_aim(vec3 portal, vec3 direction, double depth_mm);

// Somewhere in the joint, clear of all surfaces by 0.2 mm. All bodies are at the identity.
struct probe probe_in_knee(const struct bodies *knee, struct random *r);

// Moved on until it touches, to 1e-6 mm; how.
struct probe probe_in_touch(const struct bodies *knee, struct random *r,
                            enum probe_touch *out_touch);

// From the nearest surface, negative inside; of closed surfaces with no sharp edge.
double bodies_gap(const struct bodies *bodies, vec3 p);

// The surfaces where their displacements take them, themselves not displaced.
void bodies_displaced(struct bodies *out, const struct bodies *bodies);
