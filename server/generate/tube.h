// Menisci and ligaments of the knee that generate/shape.h describes: closed tubes swept along a
// curve, rounded off to a point at both ends.
#pragma once

#include "base/joint.h"
#include "mesh/mesh.h"

#include <stdbool.h>

// A C of wedge sections on the plateau: thick at the rim, thin at the inner margin, everywhere
// below what the femur sweeps. Its rim is as high as `volume` (mm³) asks for; false where no
// height gives it. The caller releases *out_mesh with mesh_fini.
bool tube_meniscus(bool lateral, double volume, double edge, struct mesh *out_mesh);

struct ligament {
    const char *name;
    vec3 path[4]; // control points of a Bézier curve, from femur to tibia
    vec3 flat;    // about the direction of the smaller half axis
    double half_width, half_thickness;
};

#define LIGAMENT_COUNT 4
extern const struct ligament ligaments[LIGAMENT_COUNT];

vec3 tube_curve(const vec3 *path, double t); // 0 to 1, of the Bézier curve of its four points
void tube_ligament(const struct ligament *ligament, double edge, struct mesh *out_mesh);
