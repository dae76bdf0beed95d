// Closed bodies to cut, made in code.
#pragma once

#include "mesh/mesh.h"

// A generated meniscus of about so many triangles, 2200 mm³. Released with mesh_fini.
void specimen_meniscus(struct mesh *out, bool is_lateral, int triangles);

enum specimen {
    SPECIMEN_BOX,      // 12 triangles
    SPECIMEN_SPHERE,   // 1152
    SPECIMEN_TORUS,    // 960
    SPECIMEN_SLAB,     // 768, all of them in six planes
    SPECIMEN_MENISCUS, // 1300
    SPECIMENS
};

const char *specimen_name(enum specimen specimen);
void specimen_make(enum specimen specimen, struct mesh *out);
