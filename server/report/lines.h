// Lines as surfaces, so that they can be seen in a picture.
#pragma once

#include "mesh/mesh.h"

struct line {
    vec3 from, to;
};

// A closed rod with six sides about each line; lines without length are left out. The caller
// releases *out_mesh with mesh_fini.
void lines_mesh(const struct line *lines, size_t count, double radius_mm, struct mesh *out_mesh);
