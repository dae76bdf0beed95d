#include "scene/world.h"

#include "base/check.h"

#include <stdlib.h>

pose world_small_pose(struct random *r, double angle_rad, double length_mm) {
    quat q = quat_from_axis_angle(random_direction(r), angle_rad);
    return (pose){q, vec3_scale(length_mm, random_direction(r))};
}

void world_place(struct world *w, struct random *r, bool corrected) {
    for (int i = 0; i < 3; i++) {
        w->B[i] = world_small_pose(r, 0.2, 2);
        w->M[i] = world_small_pose(r, 0.1, 1);
    }
    w->scene.T_world_body = w->B;
    w->scene.correction = corrected ? w->M : NULL;
}

static void bridge(struct world *w) {
    struct warp_surface *last = &w->bodies.surfaces[w->bodies.count - 1];
    w->share = alloc(last->mesh->vertex_count, sizeof *w->share);
    for (uint32_t v = 0; v < last->mesh->vertex_count; v++)
        w->share[v] = (float)(0.5 + 0.5 * sin(0.3 * mesh_vertex(last->mesh, v).x));
    last->other_share = w->share;
    last->other_body = (last->body + 1) % 3;
}

void world_create(struct world *w, struct random *r, bool corrected) {
    bodies_knee(&w->bodies, 8);
    bridge(w);
    w->scene =
        (struct warp_scene){.surfaces = w->bodies.surfaces, .surface_count = w->bodies.count};
    world_place(w, r, corrected);
}

vec3 world_somewhere(struct random *r) {
    return bodies_knee_path(random_between(r, 0, 3000));
}

struct warp world_warp(const struct warp_scene *scene, const struct field *field, vec3 y) {
    struct warp_memory memory;
    struct warp warp;
    warp_memory_init(&memory);
    warp_point(scene, field, y, &memory, &warp);
    return warp;
}

struct closest world_contact(const struct warp_scene *scene, int surface, vec3 y) {
    struct closest c;
    vec3 p = pose_apply_inverse(scene->T_world_body[scene->surfaces[surface].body], y);
    CHECK(query_closest(scene->surfaces[surface].query, p, INFINITY, MESH_NONE, &c));
    return c;
}

vec3 world_point_on(const struct world *w, int surface, struct random *r) {
    const struct mesh *mesh = w->scene.surfaces[surface].mesh;
    uint32_t t = (uint32_t)(random_bits(r) % mesh->triangle_count);
    double u = random_between(r, 0, 1), v = random_between(r, 0, 1 - u);
    vec3 x = vec3_add_scaled(
        vec3_add_scaled(vec3_scale(1 - u - v, mesh_corner(mesh, t, 0)), u, mesh_corner(mesh, t, 1)),
        v, mesh_corner(mesh, t, 2));
    return pose_apply(w->B[w->scene.surfaces[surface].body], x);
}

double world_clearance(const struct world *w, int surface, vec3 y) {
    double nearest = INFINITY;
    for (int i = 0; i < w->scene.surface_count; i++)
        if (i != surface)
            nearest = fmin(nearest, world_contact(&w->scene, i, y).distance);
    return nearest;
}

void world_fini(struct world *w) {
    bodies_fini(&w->bodies);
    free(w->share);
}
