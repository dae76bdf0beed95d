// Part of a washer as a meniscus whose volumes are known, and a session's tissue of it: for tests
// of server/quality. Millimetres.
#pragma once

#include "quality/quality.h"

// Around z, x anterior, z up: from angle -half to half about -y.
struct washer {
    double inner, outer, height, half;
};

extern const struct washer washer_usual;

vec3 washer_point(double angle, double r, double z);
double washer_third(const struct washer *washer, int across); // radius where a third begins
void washer_mesh(const struct washer *washer, pose T_mesh_washer, struct mesh *out_mesh);

static inline double washer_sector(double inner, double outer, double height, double angle) {
    return (outer * outer - inner * inner) * height * angle / 2;
}

struct washer_scene {
    pose T_mesh_washer;
    struct mesh tissue;
    struct quality_plan *plan;
    struct quality *quality;
};

// setting: tissue and directions are set here.
void washer_scene_begin(struct washer_scene *scene, const struct washer *washer, pose T_mesh_washer,
                        struct quality_setting setting);
void washer_scene_end(struct washer_scene *scene);

struct quality_report quality_of(const struct washer_scene *scene);
double zones_sum(const struct zone_volumes *volumes);
void zones_add_mesh(const struct quality_plan *plan, const struct mesh *mesh, double times,
                    struct zone_volumes *volumes);

struct convex convex_box(pose T_mesh_box, vec3 low, vec3 high);
void convex_mesh(const struct convex *convex, struct mesh *out_mesh); // each face as a fan
