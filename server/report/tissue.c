#include "report/tissue.h"

#include "case/tissue.h"

#define TISSUE_CREASE_DEG 35
#define LINE_SHARE 0.0013 // a line's radius, of the picture's height

static const struct colour tissue_background = {1, 1, 1};
static const struct colour cut = {0.93, 0.60, 0.50};
static const struct colour displaced = {0.47, 0.10, 0.62};

static struct colour colour_between(struct colour a, struct colour b, double share) {
    return (struct colour){a.r + share * (b.r - a.r), a.g + share * (b.g - a.g),
                           a.b + share * (b.b - a.b)};
}

static struct colour paint_tissue(const void *context, const struct render_spot *spot) {
    const struct tissue_look *look = context;
    if (look->labels && look->labels[spot->triangle])
        return cut;
    double share = 0;
    for (size_t i = 0; look->blends && i < 3; i++) {
        uint32_t vertex = look->mesh->triangles[3 * (size_t)spot->triangle + i];
        share += spot->weights[i] * look->blends[vertex];
    }
    double rgb[3];
    tissue_rgb(look->colour, rgb);
    return colour_between((struct colour){rgb[0], rgb[1], rgb[2]}, displaced, share);
}

enum result tissue_picture(const struct tissue_look *look, const struct camera *camera, int width,
                           int height, struct picture *out_picture, struct error *err) {
    struct mesh lines;
    rods_mesh(look->lines, look->line_count, LINE_SHARE * camera->height_mm, &lines);
    const struct render_surface surfaces[] = {
        {.mesh = look->mesh,
         .T_world_mesh = pose_identity(),
         .crease_deg = TISSUE_CREASE_DEG,
         .opacity = 1,
         .paint = paint_tissue,
         .paint_context = look},
        {.mesh = &lines,
         .T_world_mesh = pose_identity(),
         .crease_deg = 90,
         .opacity = 1,
         .colour = displaced},
    };
    struct render_scene scene = {surfaces, 2, *camera, tissue_background};
    enum result result = render(&scene, width, height, out_picture, err);
    mesh_fini(&lines);
    return result;
}
