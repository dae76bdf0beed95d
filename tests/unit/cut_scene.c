#include "unit/cut_scene.h"

#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- scenes ----

struct cut_mesh *cut_mesh_of(struct mesh *shape) {
    struct cut_mesh *mesh;
    struct error err;
    assert_int_equal(cut_mesh_create(shape, &mesh, &err), RESULT_OK);
    mesh_fini(shape);
    return mesh;
}

struct cut_mesh *cube(double half) {
    struct mesh shape;
    shape_box(&shape, (vec3){half, half, half});
    return cut_mesh_of(&shape);
}

struct cut_mesh *sphere(double radius, int n) {
    struct mesh shape;
    shape_sphere(&shape, radius, n);
    return cut_mesh_of(&shape);
}

struct convex box(vec3 low, vec3 high) {
    struct plane planes[6] = {{{1, 0, 0}, high.x},  {{-1, 0, 0}, -low.x}, {{0, 1, 0}, high.y},
                              {{0, -1, 0}, -low.y}, {{0, 0, 1}, high.z},  {{0, 0, -1}, -low.z}};
    struct convex out;
    assert_int_equal(convex_create(planes, 6, &out, NULL), RESULT_OK);
    return out;
}

struct convex random_convex(struct random *r, vec3 centre, double size) {
    struct plane planes[24];
    struct convex out;
    do
        for (int i = 0; i < 24; i++) {
            vec3 n = random_direction(r);
            planes[i] = (struct plane){n, vec3_dot(n, centre) + size * random_between(r, 0.7, 1)};
        }
    while (convex_create(planes, 24, &out, NULL) != RESULT_OK);
    return out;
}

struct convex random_bite(struct random *r, const struct cut_mesh *mesh, double size) {
    uint32_t t;
    do
        t = (uint32_t)(random_bits(r) % cut_mesh_triangle_bound(mesh));
    while (!cut_mesh_triangle_alive(mesh, t));
    vec3 p = cut_mesh_vertex(mesh, cut_mesh_triangle(mesh, t)[0]);
    return random_convex(r, vec3_add(p, random_in_box(r, size / 2)), size);
}

struct cut_change cut(struct cut_mesh *mesh, struct convex blade) {
    struct cut_change change;
    struct error err;
    assert_int_equal(cut_apply(mesh, &blade, 1, &change, &err), CUT_CHANGED);
    return change;
}

struct topology sound_topology(const struct cut_mesh *mesh) {
    struct mesh flat;
    cut_mesh_flatten(mesh, &flat, NULL, NULL);
    assert_int_equal(mesh_validate(&flat, NULL), RESULT_OK);
    struct topology topology = topology_of(&flat);
    assert_true(topology.closed && topology.manifold && topology.oriented);
    assert_int_equal(topology.unused_vertices, 0);
    assert_near(mesh_volume(&flat), cut_mesh_volume(mesh), 1e-5 * (1 + cut_mesh_volume(mesh)));
    mesh_fini(&flat);
    return topology;
}

double area_of(const struct cut_mesh *mesh) {
    struct mesh flat;
    cut_mesh_flatten(mesh, &flat, NULL, NULL);
    double area = mesh_area(&flat);
    mesh_fini(&flat);
    return area;
}

// ---- pictures ----

struct picture take_picture(const struct cut_mesh *mesh) {
    struct picture p = {.vertex_bound = cut_mesh_vertex_bound(mesh),
                        .triangle_bound = cut_mesh_triangle_bound(mesh)};
    p.vertex_alive = calloc(p.vertex_bound, sizeof *p.vertex_alive);
    p.points = calloc(p.vertex_bound, sizeof *p.points);
    p.corners = malloc(3 * sizeof *p.corners * p.triangle_bound);
    p.labels = calloc(p.triangle_bound, sizeof *p.labels);
    memset(p.corners, 0xff, 3 * sizeof *p.corners * p.triangle_bound);
    for (uint32_t v = 0; v < p.vertex_bound; v++)
        if ((p.vertex_alive[v] = cut_mesh_vertex_alive(mesh, v)))
            p.points[v] = cut_mesh_vertex(mesh, v);
    for (uint32_t t = 0; t < p.triangle_bound; t++)
        if (cut_mesh_triangle_alive(mesh, t)) {
            memcpy(p.corners + 3 * t, cut_mesh_triangle(mesh, t), 3 * sizeof *p.corners);
            p.labels[t] = cut_mesh_label(mesh, t);
        }
    return p;
}

void drop_picture(struct picture *p) {
    free(p->vertex_alive);
    free(p->points);
    free(p->corners);
    free(p->labels);
}

void assert_same(const struct cut_mesh *a, const struct cut_mesh *b) {
    struct picture p = take_picture(a), q = take_picture(b);
    assert_int_equal(p.vertex_bound, q.vertex_bound);
    assert_int_equal(p.triangle_bound, q.triangle_bound);
    assert_memory_equal(p.vertex_alive, q.vertex_alive, p.vertex_bound * sizeof *p.vertex_alive);
    assert_memory_equal(p.points, q.points, p.vertex_bound * sizeof *p.points);
    assert_memory_equal(p.corners, q.corners, 3 * p.triangle_bound * sizeof *p.corners);
    assert_memory_equal(p.labels, q.labels, p.triangle_bound * sizeof *p.labels);
    drop_picture(&p);
    drop_picture(&q);
}

bool contains(const uint32_t *ids, uint32_t count, uint32_t id) {
    for (uint32_t i = 0; i < count; i++)
        if (ids[i] == id)
            return true;
    return false;
}
