#include "scene/bodies.h"

#include "base/check.h"
#include "base/log.h"

#include <stdlib.h>

void bodies_add(struct bodies *bodies, struct mesh *mesh, float *displacement, int body) {
    CHECK(bodies->count < BODIES_MAX);
    int i = bodies->count++;
    struct error err;
    bodies->meshes[i] = *mesh;
    bodies->displacements[i] = displacement;
    *mesh = (struct mesh){0};
    if (query_create(&bodies->meshes[i], &bodies->queries[i], &err) != RESULT_OK) {
        log_error("scene", "%s", err.text);
        abort();
    }
    bodies->surfaces[i] =
        (struct warp_surface){&bodies->meshes[i], bodies->queries[i], displacement, body};
}

void bodies_smooth(struct bodies *bodies) {
    for (int i = 0; i < bodies->count; i++) {
        if (!bodies->displacements[i] || bodies->surfaces[i].other_share)
            continue;
        bodies->trees[i] = surface_tree_create(&bodies->meshes[i]);
        bodies->means[i] = surface_mean_create(bodies->trees[i], bodies->displacements[i]);
        bodies->surfaces[i].mean = bodies->means[i];
    }
}

void bodies_integrate(struct bodies *bodies) {
    for (int i = 0; i < bodies->count; i++) {
        bodies->blocks[i] = surface_blocks_create(&bodies->meshes[i]);
        bodies->integrals[i] = surface_integral_create(bodies->blocks[i], bodies->displacements[i]);
        bodies->surfaces[i].integral = bodies->integrals[i];
    }
}

void bodies_fini(struct bodies *bodies) {
    for (int i = 0; i < bodies->count; i++) {
        surface_integral_destroy(&bodies->integrals[i]);
        surface_blocks_destroy(&bodies->blocks[i]);
        surface_mean_destroy(&bodies->means[i]);
        surface_tree_destroy(&bodies->trees[i]);
        query_destroy(&bodies->queries[i]);
        mesh_fini(&bodies->meshes[i]);
        free(bodies->displacements[i]);
    }
    *bodies = (struct bodies){0};
}

static pose at(double x, double y, double z) {
    return (pose){quat_identity(), {x, y, z}};
}

void bodies_walls(struct bodies *out, double gap_mm, double rise_mm) {
    struct mesh wall;
    shape_grid(&wall, 30, 20);
    shape_move(&wall, at(0, 0, -gap_mm / 2));
    float *displacement = alloc(3 * (size_t)wall.vertex_count, sizeof *displacement);
    for (uint32_t v = 0; v < wall.vertex_count; v++)
        displacement[3 * (size_t)v + 2] = (float)rise_mm;
    *out = (struct bodies){0};
    bodies_add(out, &wall, displacement, 0);
    shape_grid(&wall, 30, 20);
    shape_move(&wall, (pose){{0, 1, 0, 0}, {0, 0, gap_mm / 2}}); // half a turn about x
    bodies_add(out, &wall, NULL, 0);
}

static void add_bone(struct bodies *out, vec3 radii, vec3 centre, int n, int body) {
    struct mesh mesh;
    shape_bumpy(&mesh, radii, 3, n, (uint64_t)body + 1);
    shape_move(&mesh, at(centre.x, centre.y, centre.z));
    float *displacement = shape_displacement(&mesh, 3, (uint64_t)body + 11);
    bodies_add(out, &mesh, displacement, body);
}

static void add_meniscus(struct bodies *out, double x, int n) {
    struct mesh mesh;
    shape_torus(&mesh, 13, 3, 4 * n, n);
    shape_move(&mesh, at(x, 0, 0));
    float *displacement = shape_displacement(&mesh, 3, 12);
    bodies_add(out, &mesh, displacement, 1);
}

void bodies_knee(struct bodies *out, int n) {
    *out = (struct bodies){0};
    add_bone(out, (vec3){40, 32, 30}, (vec3){0, 0, 34}, n, 0);
    add_bone(out, (vec3){39, 27, 28}, (vec3){0, 0, -32}, n, 1);
    add_meniscus(out, -20, n);
    add_meniscus(out, 20, n);
    add_bone(out, (vec3){21, 9, 22}, (vec3){0, 45, 32}, n, 2);
}

vec3 bodies_knee_path(double t) {
    return (vec3){30 * sin(t / 31), 3 + 17 * sin(t / 47 + 1), 4 * sin(t / 23 + 2)};
}
