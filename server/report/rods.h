// Straight lines as rods, so that a picture shows them.
#pragma once

#include "mesh/mesh.h"

struct rod {
    vec3 from, to;
};

// A closed mesh with six sides for each rod; rods without length are left out. The caller
// releases *out_mesh with mesh_fini.
void rods_mesh(const struct rod *rods, size_t count, double radius_mm, struct mesh *out_mesh);
