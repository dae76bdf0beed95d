#include "cutting/specimens.h"

#include "base/check.h"
#include "generate/tube.h"
#include "cutting/voxels.h"
#include "scene/shapes.h"

void specimen_meniscus(struct mesh *out, bool is_lateral, int triangles) {
    CHECK(tube_meniscus(is_lateral, 2200, sqrt(5100.0 / triangles), out));
}

const char *specimen_name(enum specimen specimen) {
    static const char *const names[SPECIMENS] = {"box", "sphere", "torus", "slab", "meniscus"};
    return names[specimen];
}

void specimen_make(enum specimen specimen, struct mesh *out) {
    switch (specimen) {
    case SPECIMEN_BOX:
        shape_box(out, (vec3){6, 5, 4});
        break;
    case SPECIMEN_SPHERE:
        shape_sphere(out, 6, 12);
        break;
    case SPECIMEN_TORUS:
        shape_torus(out, 7, 2.5, 40, 12);
        break;
    case SPECIMEN_SLAB:
        lattice_cube(out, 4, 8);
        break;
    default:
        specimen_meniscus(out, false, 1300);
    }
}
