// Pictures of tissue that is being resected. Cut surfaces are salmon, displacements purple lines.
#pragma once

#include "report/render.h"
#include "report/rods.h"

struct tissue_look {
    const struct mesh *mesh;
    uint32_t colour;         // of the original surface, 0xRRGGBB
    const uint32_t *labels;  // of each triangle, 0: original surface; NULL: all is
    const double *blends;    // of each vertex, 0 to 1, shaded towards purple; or NULL
    const struct rod *lines; // displacements
    size_t line_count;
};

// The caller releases *out_picture.
enum result tissue_picture(const struct tissue_look *look, const struct camera *camera, int width,
                           int height, struct picture *out_picture, struct error *err);
