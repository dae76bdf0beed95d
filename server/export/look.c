#include "export/look.h"

#include <string.h>

#define SHAFT_MM 130.0
#define CONE_MM 4.0
#define RADIUS_MM 1.5 // of a shaft whose settings say nothing else
#define AROUND 12

static const struct {
    const char *name;
    float rgba[4];
} looks[LOOK_COUNT] = {
    [LOOK_BONE] = {"bone", {0.94F, 0.89F, 0.77F, 1}},
    [LOOK_MENISCUS] = {"meniscus", {0.66F, 0.77F, 0.84F, 1}},
    [LOOK_LIGAMENT] = {"ligament", {0.85F, 0.90F, 0.91F, 1}},
    [LOOK_SKIN] = {"skin", {0.86F, 0.70F, 0.64F, 0.15F}},
    [LOOK_STEEL] = {"instrument", {0.45F, 0.47F, 0.50F, 1}},
};

const char *look_name(enum look look) {
    return looks[look].name;
}

const float *look_rgba(enum look look) {
    return looks[look].rgba;
}

enum look look_of_group(const struct case_group *group) {
    if (case_group_is_skin(group))
        return LOOK_SKIN;
    if (group->cuttable || !strncmp(group->name, "meniscus", 8))
        return LOOK_MENISCUS;
    return group->bridges ? LOOK_LIGAMENT : LOOK_BONE;
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
