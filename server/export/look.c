#include "export/look.h"

#include <string.h>

#define SHAFT_MM 130.0
#define CONE_MM 4.0
#define RADIUS_MM 1.5 // of a shaft whose settings say nothing else
#define AROUND 12
#define RINGS 7

static const double skin_opacity = 0.15;
static const uint32_t steel = 0x737880, fragment = 0xf4ead6;

static void take_rgba(uint32_t colour, double opacity, float out[4]) {
    double rgb[3];
    tissue_rgb(colour, rgb);
    for (int i = 0; i < 3; i++)
        out[i] = (float)rgb[i];
    out[3] = (float)opacity;
}

void look_of_group(const struct case_group *group, float out_rgba[4]) {
    take_rgba(group->tissue.colour, case_group_is_skin(group) ? skin_opacity : 1, out_rgba);
}

void look_of_instrument(const struct instrument *instrument, float out_rgba[4]) {
    take_rgba(instrument->colour == INSTRUMENT_PLAIN ? steel : instrument->colour, 1, out_rgba);
}

static double radius_of(const struct instrument_body *body) {
    double radius = RADIUS_MM;
    for (int i = 0; i < body->point_count; i++)
        radius = fmax(radius, body->points[i].radius_mm);
    return radius;
}

void look_instrument(const struct instrument_body *body, struct mesh *mesh) {
    double radius = radius_of(body);
    mesh_init(mesh, 2 * AROUND + 2, 4 * AROUND);
    uint32_t tip = 2 * AROUND, end = tip + 1, *t = mesh->triangles;
    for (uint32_t i = 0; i < AROUND; i++) {
        double angle = 2 * M_PI * i / AROUND, x = radius * cos(angle), y = radius * sin(angle);
        uint32_t next = (i + 1) % AROUND;
        mesh_set_vertex(mesh, i, (vec3){x, y, -CONE_MM});
        mesh_set_vertex(mesh, AROUND + i, (vec3){x, y, -SHAFT_MM});
        const uint32_t corners[12] = {i,          next, tip, AROUND + i,    AROUND + next, next,
                                      AROUND + i, next, i,   AROUND + next, AROUND + i,    end};
        memcpy(t + 12 * i, corners, sizeof corners);
    }
    mesh_set_vertex(mesh, tip, (vec3){0, 0, 0});
    mesh_set_vertex(mesh, end, (vec3){0, 0, -SHAFT_MM});
}

// Rings from pole to pole, which are the last two vertices.
void look_loose(vec3 radii_mm, struct mesh *mesh, float out_rgba[4]) {
    const uint32_t south = RINGS * AROUND, north = south + 1;
    mesh_init(mesh, RINGS * AROUND + 2, 2 * RINGS * AROUND);
    uint32_t *t = mesh->triangles;
    for (uint32_t r = 0; r < RINGS; r++)
        for (uint32_t i = 0; i < AROUND; i++) {
            double up = M_PI * (r + 1) / (RINGS + 1), round = 2 * M_PI * i / AROUND;
            uint32_t here = r * AROUND + i, beside = r * AROUND + (i + 1) % AROUND;
            mesh_set_vertex(mesh, here,
                            (vec3){radii_mm.x * sin(up) * cos(round),
                                   radii_mm.y * sin(up) * sin(round), -radii_mm.z * cos(up)});
            uint32_t below = r ? here - AROUND : south,
                     above = r + 1 < RINGS ? beside + AROUND : north;
            const uint32_t corners[6] = {here, below, beside, here, beside, above};
            memcpy(t, corners, sizeof corners);
            t += 6;
        }
    mesh_set_vertex(mesh, south, (vec3){0, 0, -radii_mm.z});
    mesh_set_vertex(mesh, north, (vec3){0, 0, radii_mm.z});
    take_rgba(fragment, 1, out_rgba);
}
