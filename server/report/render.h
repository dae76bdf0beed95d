// A picture of surfaces, by ray casting on the CPU (Embree behind this header). Millimetres.
//
// A surface of colour c with the unit normal n shows, in linear light,
//
//     c (0.45 o + 0.62 max(0, n·a) + 0.16 max(0, n·b))
//
// o: the share of the directions about n, as n sees them, that are free over a quarter of the
// picture's height (32 rays a pixel); a, b: two lights that go with the camera, from above left and
// from the right. Four samples a pixel, evenly. The same scene gives the same bytes on a machine.
#pragma once

#include "report/camera.h"
#include "report/picture.h"

struct colour {
    double r, g, b; // sRGB, 0 to 1
};

// A place on a surface, for those who paint it.
struct render_spot {
    uint32_t triangle;
    double weights[3]; // barycentric
    vec3 point;        // in the mesh's frame
};

typedef struct colour render_paint(const void *context, const struct render_spot *spot);

struct render_surface {
    const struct mesh *mesh; // passes mesh_validate, or has no triangles
    pose T_world_mesh;
    double crease_deg; // faces that meet at less look smooth; 0: flat
    double opacity;    // 1; less shows what lies behind, and keeps no light from others
    struct colour colour;
    render_paint *paint; // or NULL: `colour` everywhere
    const void *paint_context;
};

struct render_scene {
    const struct render_surface *surfaces;
    int surface_count;
    struct camera camera;
    struct colour background;
};

// The caller releases *out_picture. RESULT_IO where Embree cannot build.
enum result render(const struct render_scene *scene, int width, int height,
                   struct picture *out_picture, struct error *err);
